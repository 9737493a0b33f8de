//! Where to send the rays that stand for many: evenly spread, and the same each time.

use glam::Vec3;
use std::f32::consts::TAU;

/// Points spread evenly over the unit square, shifted for each pixel so that neighbours differ.
pub struct Samples {
    shift: [f32; 2],
    next: u32,
}

impl Samples {
    /// The points for pixel `x`, `y`.
    pub fn for_pixel(x: u32, y: u32) -> Self {
        let bits = scramble(x ^ scramble(y));
        Self {
            shift: [bits, scramble(bits)].map(|bits| bits as f32 / u32::MAX as f32),
            next: 0,
        }
    }

    /// The next point. However many are taken, they lie evenly: the R2 sequence (Roberts 2018), each axis a
    /// multiple of a power of the plastic number's inverse.
    pub fn point(&mut self) -> [f32; 2] {
        const STEP: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];
        let index = f64::from(self.next);
        self.next += 1;
        [0, 1].map(|axis| (f64::from(self.shift[axis]) + index * STEP[axis]).fract() as f32)
    }

    /// A direction around `normal`, likelier the nearer it is to it: by the cosine, as light counts.
    pub fn around(&mut self, normal: Vec3) -> Vec3 {
        let [height, turn] = self.point();
        let (sin, cos) = (TAU * turn).sin_cos();
        let out = height.sqrt();
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        out * (cos * tangent + sin * bitangent) + (1.0 - height).sqrt() * normal
    }
}

/// A number that shows no relation to `bits`: the permutation of PCG (O'Neill 2014).
fn scramble(bits: u32) -> u32 {
    let state = bits.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}
