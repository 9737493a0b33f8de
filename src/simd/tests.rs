//! Every operation that decides a hit, on every backend of this machine, held to plain floats, bit for bit.

use super::{Backend, F32x1, Operation, PacketOperation, Portable, Simd, Vector};
use core::hint::black_box;
use fastrand::Rng;

/// Ordinary numbers, and those that are not.
fn number(rng: &mut Rng) -> f32 {
    match rng.u32(..4) {
        0 => f32::from_bits(rng.u32(..)),
        1 => [0.0, -0.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 1e-45][rng.usize(..6)],
        _ => rng.f32() * 2.0 - 1.0,
    }
}

/// NaNs are all alike.
#[track_caller]
fn assert_same<const N: usize>(found: [f32; N], expected: [f32; N]) {
    for (found, expected) in found.into_iter().zip(expected) {
        let alike = found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan();
        assert!(alike, "{found:?}, not {expected:?}");
    }
}

fn check<const N: usize, V: Vector<N>>(token: V::Token) {
    let mut rng = Rng::with_seed(11);
    for _ in 0..2000 {
        let [a, b, c] = [(); 3].map(|()| [(); N].map(|()| black_box(number(&mut rng))));
        let [x, y, z] = [V::load(token, &a), V::load(token, &b), V::load(token, &c)];
        let lanes = |f: fn(f32, f32, f32) -> f32| {
            let mut lanes = [0.0; N];
            for (lane, number) in lanes.iter_mut().enumerate() {
                *number = f(a[lane], b[lane], c[lane]);
            }
            lanes
        };
        let mask = |f: fn(f32, f32) -> bool| {
            (0..N).fold(0, |mask, lane| {
                mask | u32::from(f(a[lane], b[lane])) << lane
            })
        };
        assert_same((x + y).to_array(), lanes(|a, b, _| a + b));
        assert_same((x - y).to_array(), lanes(|a, b, _| a - b));
        assert_same((x * y).to_array(), lanes(|a, b, _| a * b));
        assert_same((x / y).to_array(), lanes(|a, b, _| a / b));
        assert_same(x.abs().to_array(), lanes(|a, _, _| a.abs()));
        // Rounded after each operation: nothing is fused that was not asked for.
        let rounded = |x: f32| black_box(x);
        assert_same((x * y + z).to_array(), {
            let products = (x * y).to_array().map(rounded);
            (V::load(token, &products) + z).to_array()
        });
        assert_same(
            (x * y + z).to_array(),
            lanes(|a, b, c| black_box(a * b) + c),
        );
        assert_same(
            (z - x * y).to_array(),
            lanes(|a, b, c| c - black_box(a * b)),
        );

        assert_eq!(x.bits(), mask(|a, _| a.is_sign_negative()));
        assert_eq!(x.lt(y).bits(), mask(|a, b| a < b));
        assert_eq!(x.le(y).bits(), mask(|a, b| a <= b));
        assert_eq!(x.eq(y).bits(), mask(|a, b| a == b));
        assert_eq!((x.lt(y) | x.eq(y)).bits(), mask(|a, b| a <= b));
        assert_eq!((x.le(y) & y.le(x)).bits(), mask(|a, b| a == b));
        assert_same(
            x.lt(y).select(y, z).to_array(),
            lanes(|a, b, c| if a < b { b } else { c }),
        );
        // The lesser and the greater, of numbers.
        let numbers = lanes(|a, b, _| {
            if a.is_nan() || b.is_nan() {
                f32::NAN
            } else {
                0.0
            }
        });
        let min = (x.min(y) + V::load(token, &numbers)).to_array();
        assert_same(
            min,
            lanes(|a, b, _| {
                if a.is_nan() || b.is_nan() {
                    f32::NAN
                } else {
                    a.min(b) + 0.0
                }
            }),
        );
        let max = (x.max(y) + V::load(token, &numbers)).to_array();
        assert_same(
            max,
            lanes(|a, b, _| {
                if a.is_nan() || b.is_nan() {
                    f32::NAN
                } else {
                    a.max(b) + 0.0
                }
            }),
        );
        // Those that look at bits, of numbers; -0 may count as less than 0.
        let by_bits = [x.max_from_zero(y), x.min_from_zero(y)].map(|of_bits| of_bits.to_array());
        for (lane, (&a, &b)) in a.iter().zip(&b).enumerate() {
            if a.is_nan() || b.is_nan() {
                continue;
            }
            let [max, min] = by_bits.map(|lanes| lanes[lane]);
            if a.is_sign_negative() && b.is_sign_negative() {
                assert!([max, min].iter().all(|&found| found == a || found == b));
            } else {
                assert_eq!([max, min], [a.max(b), a.min(b)]);
            }
        }

        let bits = rng.u32(..) & (u32::MAX >> (32 - N));
        assert_eq!(V::of_bits(token, bits).bits(), bits);
        let from = [(); N].map(|()| rng.u8(..N as u8));
        assert_same(
            x.permute(&from).to_array(),
            from.map(|lane| a[lane as usize]),
        );
        let bytes = [(); N].map(|()| rng.u8(..));
        assert_same(V::of_bytes(token, &bytes).to_array(), bytes.map(f32::from));
        let lane = rng.usize(..N);
        let mut replaced = a;
        replaced[lane] = b[0];
        assert_same(x.replace(token, lane, b[0]).to_array(), replaced);
        assert_same(V::splat(token, a[0]).to_array(), [a[0]; N]);

        let rows = [(); N].map(|()| [(); 8].map(|()| number(&mut rng)));
        let columns = V::columns(token, rows.each_ref());
        for (column, found) in columns.into_iter().enumerate() {
            assert_same(found.to_array(), rows.map(|row| row[column]));
        }

        let mut kept = [0.0; N];
        // SAFETY: as many places as lanes.
        unsafe { x.compress(bits, kept.as_mut_ptr()) };
        let expected = (0..N)
            .filter(|lane| bits >> lane & 1 != 0)
            .map(|lane| a[lane]);
        for (found, expected) in kept.into_iter().zip(expected) {
            assert_same([found], [expected]);
        }
    }
}

struct Check;

impl Operation for Check {
    type Output = ();

    fn run<S: Simd>(self, token: S) {
        check::<4, S::F32x4>(token);
        check::<8, S::F32x8>(token);
        token.in_packets(self);
    }
}

impl PacketOperation for Check {
    type Output = ();

    fn run<const N: usize, V: Vector<N>>(self, token: V::Token) {
        check::<N, V>(token);
    }
}

#[test]
fn operations_are_those_of_floats() {
    for backend in Backend::available() {
        backend.run(Check);
    }
    check::<1, F32x1>(Portable);
}
