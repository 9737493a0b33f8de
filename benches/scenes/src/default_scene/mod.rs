//! A scene of its own, so that there is something to trace without a file: a sculpture in a court among hills.
//!
//! Fine and coarse geometry side by side, thin boards, long shadows, things behind things. One unit is a metre.

mod colonnade;
mod court;
mod land;
mod stair;

use crate::{Camera, Mesh};

pub(crate) const NAME: &str = "default scene";

/// Hills and trees around a round court with a colonnade; in it a knot of 100,000 triangles, spheres, a spiral
/// stair, a roof of thin slats. About 340,000 triangles, the same each time.
pub fn default_scene() -> Mesh {
    let mut scene = Mesh {
        name: NAME.into(),
        ..Mesh::default()
    };
    for part in [
        land::hills(),
        land::cypresses(),
        court::steps(),
        court::floor(),
        colonnade::columns(),
        colonnade::arches(),
        colonnade::cornice(),
        colonnade::slats(),
        court::sculpture(),
        court::spheres(),
        stair::stair(),
    ] {
        scene.append(&part);
    }
    scene
}

/// In front of the opening, above head height.
pub(crate) fn camera() -> Camera {
    Camera::look_at([6.4, 4.6, 16.5], [0.2, 3.0, 0.0], 42.0_f32.to_radians())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_of_the_promised_size_and_always_the_same() {
        let scene = default_scene();
        assert!((150_000..400_000).contains(&scene.indices.len()));
        assert!(scene.positions.iter().flatten().all(|x| x.is_finite()));
        let vertices = scene.positions.len() as u32;
        assert!(scene.indices.iter().flatten().all(|&i| i < vertices));
        assert_eq!(scene, default_scene());
    }
}
