//! The colonnade: columns, arches between them, a cornice, and slats on top, along a part of a circle.

use crate::{
    Mesh,
    shapes::{Wrap, cuboid, patch},
};
use glam::{Quat, Vec3};
use std::f32::consts::{PI, TAU};

/// How many arches there are; the circle is open towards the camera.
const BAYS: usize = 9;
/// The angle of one.
const BAY: f32 = TAU / 15.0;
/// The middle of the opening.
const OPENING: f32 = 0.35;
/// How far the columns stand from the middle.
const RADIUS: f32 = 9.5;
/// Where arches begin, above the floor.
const SPRING: f32 = 4.2;
/// Where the wall above the arches ends.
const WALL_TOP: f32 = 6.5;

/// A base, a fluted shaft that swells a little, a capital.
pub(super) fn columns() -> Mesh {
    const SIDES: usize = 48;
    const SHAFT: usize = 14;
    let mut profile = vec![
        [0.62, -0.2],
        [0.62, 0.15],
        [0.58, 0.2],
        [0.6, 0.28],
        [0.58, 0.36],
        [0.46, 0.4],
    ];
    let shaft = profile.len()..profile.len() + SHAFT;
    for ring in 0..SHAFT {
        let up = ring as f32 / (SHAFT - 1) as f32;
        let swell = 0.42 - 0.07 * up * up + 0.012 * (PI * up).sin();
        profile.push([swell, 0.45 + 3.2 * up]);
    }
    profile.extend([
        [0.42, 3.7],
        [0.42, 3.78],
        [0.5, 3.9],
        [0.62, 3.98],
        [0.62, SPRING],
    ]);
    let column = patch(
        "column",
        (SIDES, Wrap::Closed),
        (profile.len(), Wrap::Open),
        |side, ring| {
            let (sin, cos) = (TAU * side as f32 / SIDES as f32).sin_cos();
            let [radius, height] = profile[ring];
            // Every third edge of the shaft is cut in.
            let fluted = shaft.contains(&ring) && side % 3 == 0;
            let radius = if fluted { radius * 0.9 } else { radius };
            Vec3::new(radius * sin, height, radius * cos)
        },
    );
    along_colonnade(BAYS + 1, &column.moved(|p| p + Vec3::Z * RADIUS))
}

/// The wall over the columns, round arches cut out of it from below.
pub(super) fn arches() -> Mesh {
    const STEPS: usize = 32;
    const HALF_THICKNESS: f32 = 0.38;
    wall(STEPS * BAYS + 1, 4, |step, corner| {
        let across = (step % STEPS) as f32 / STEPS as f32 * 2.0 - 1.0;
        // The opening is a little narrower than the bay: what is left rests on the columns.
        let opening = (1.0 - (across / 0.76).powi(2)).max(0.0).sqrt();
        let [inner, outer] = [RADIUS - HALF_THICKNESS, RADIUS + HALF_THICKNESS];
        let below = SPRING + 1.5 * opening;
        [
            [inner, below],
            [inner, WALL_TOP],
            [outer, WALL_TOP],
            [outer, below],
        ][corner]
    })
}

/// The moulding along the top of the wall, with a row of teeth under it.
pub(super) fn cornice() -> Mesh {
    let half = [
        [0.38, 0.0],
        [0.5, 0.08],
        [0.52, 0.2],
        [0.7, 0.3],
        [0.7, 0.42],
    ];
    let outer = half.map(|[out, up]| [RADIUS + out, WALL_TOP + up]);
    let inner = half.map(|[out, up]| [RADIUS - out, WALL_TOP + up]);
    let section: Vec<_> = inner.into_iter().chain(outer.into_iter().rev()).collect();
    let mut cornice = wall(16 * BAYS + 1, section.len(), |_, corner| section[corner]);
    let tooth = cuboid(
        [-0.07, WALL_TOP - 0.2, RADIUS - 0.5],
        [0.07, WALL_TOP + 0.02, RADIUS + 0.5],
    );
    cornice.append(&along_colonnade(14 * BAYS, &tooth));
    cornice
}

/// Thin boards laid from the wall towards the middle.
pub(super) fn slats() -> Mesh {
    let top = WALL_TOP + 0.42;
    let board = cuboid(
        [-0.025, top, RADIUS - 3.4],
        [0.025, top + 0.22, RADIUS + 1.1],
    );
    along_colonnade(18 * BAYS, &board)
}

/// A wall along the colonnade, closed at its ends: `steps` times the outline `section(step)`, pairs of radius and
/// height, each with `corners` corners.
fn wall(steps: usize, corners: usize, section: impl Fn(usize, usize) -> [f32; 2]) -> Mesh {
    // One more section at either end, shrunk to a point, is the end's face.
    let columns = (steps + 2, Wrap::Open);
    patch(
        "wall",
        columns,
        (corners, Wrap::Closed),
        |column, corner| {
            let step = column.clamp(1, steps) - 1;
            let is_end = column == 0 || column == steps + 1;
            let [radius, height] = match is_end {
                true => {
                    let all = (0..corners).map(|corner| section(step, corner));
                    let [radius, height] = all.fold([0.0; 2], |[r, h], [dr, dh]| [r + dr, h + dh]);
                    [radius / corners as f32, height / corners as f32]
                }
                false => section(step, corner),
            };
            let turn = turn_to(BAYS as f32 * step as f32 / (steps - 1) as f32);
            turn * Vec3::new(0.0, height, radius)
        },
    )
}

/// Copies of `part`, `count` of them from one end of the colonnade to the other. `part` is where it would be along +z.
fn along_colonnade(count: usize, part: &Mesh) -> Mesh {
    let mut all = Mesh::default();
    for i in 0..count {
        let turn = turn_to(BAYS as f32 * i as f32 / (count - 1) as f32);
        all.append(&part.clone().moved(|p| turn * p));
    }
    all
}

/// The turn from +z to a place along the colonnade, 0 to [`BAYS`].
fn turn_to(bay: f32) -> Quat {
    Quat::from_rotation_y(OPENING + PI + (bay - BAYS as f32 / 2.0) * BAY)
}
