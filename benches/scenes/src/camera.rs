//! Pinhole cameras, and which of them show a mesh well.

use crate::{Mesh, default_scene};
use glam::Vec3;

/// A pinhole camera: rays fan out from one point through the pixels of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    eye: Vec3,
    forward: Vec3,
    /// To the picture's right edge, scaled by the tangent of half the vertical angle of view.
    right: Vec3,
    /// To the picture's top edge, scaled likewise.
    up: Vec3,
}

impl Camera {
    /// A camera at `eye` that looks at `target` with y up. `fov` is the vertical angle of view in radians.
    ///
    /// A target straight above or below is looked at with -z up; one equal to `eye` stands for one along -z.
    pub fn look_at(eye: impl Into<Vec3>, target: impl Into<Vec3>, fov: f32) -> Self {
        let eye = eye.into();
        let forward = (target.into() - eye).normalize_or(Vec3::NEG_Z);
        let right = forward
            .cross(Vec3::Y)
            .try_normalize()
            .unwrap_or_else(|| forward.cross(Vec3::NEG_Z).normalize());
        let scale = (fov * 0.5).tan();
        Self {
            eye,
            forward,
            right: right * scale,
            up: right.cross(forward) * scale,
        }
    }

    /// Where it stands.
    pub fn eye(&self) -> [f32; 3] {
        self.eye.to_array()
    }

    /// The ray through the centre of pixel `x`, `y` of a `width` by `height` picture, whose row 0 is the
    /// top: its origin, and its direction of unit length.
    pub fn ray(&self, x: u32, y: u32, width: u32, height: u32) -> ([f32; 3], [f32; 3]) {
        self.ray_through(x as f32 + 0.5, y as f32 + 0.5, width, height)
    }

    /// The ray through any point of the picture, in pixels from its top left corner.
    pub fn ray_through(&self, x: f32, y: f32, width: u32, height: u32) -> ([f32; 3], [f32; 3]) {
        let (width, height) = (width as f32, height as f32);
        let across = (2.0 * x - width) / height;
        let upward = 1.0 - 2.0 * y / height;
        let direction = self.forward + across * self.right + upward * self.up;
        (self.eye.to_array(), direction.normalize().to_array())
    }
}

/// Vertical angle of view from outside: narrow, so that shapes keep their proportions.
const OUTSIDE_FOV: f32 = 35.0_f32.to_radians();
/// Vertical angle of view from inside: wide, so that a room is seen at all.
const INSIDE_FOV: f32 = 65.0_f32.to_radians();

/// Meshes that are rooms or levels: to be seen from inside.
const SEEN_FROM_INSIDE: [&str; 4] = ["abyss", "kitchen", "mansion", "temple"];

/// The cameras to look at `mesh` from; there is always one at least.
///
/// A scene known by its name as a room or a level is looked at from within, at a third of its height, four ways;
/// [`default_scene`] has a place of its own; anything else is seen whole, from outside,
/// in front, to the right and above.
pub fn cameras_for(mesh: &Mesh) -> Vec<Camera> {
    cameras_of(&mesh.name, mesh.bounds())
}

/// The cameras for a mesh of that name and those bounds.
pub fn cameras_of(name: &str, (min, max): ([f32; 3], [f32; 3])) -> Vec<Camera> {
    let (min, max) = (Vec3::from(min), Vec3::from(max));
    if name == default_scene::NAME {
        vec![default_scene::camera()]
    } else if SEEN_FROM_INSIDE.contains(&name) {
        from_inside(min, max)
    } else {
        vec![from_outside(min, max)]
    }
}

fn from_inside(min: Vec3, max: Vec3) -> Vec<Camera> {
    let eye = Vec3::new(
        (min.x + max.x) * 0.5,
        min.y + (max.y - min.y) / 3.0,
        (min.z + max.z) * 0.5,
    );
    [Vec3::NEG_Z, Vec3::X, Vec3::Z, Vec3::NEG_X]
        .map(|way| {
            // Far enough that the way is not lost in the rounding of large coordinates.
            let reach = (max - min).max_element().max(f32::MIN_POSITIVE);
            Camera::look_at(eye, eye + way * reach, INSIDE_FOV)
        })
        .to_vec()
}

fn from_outside(min: Vec3, max: Vec3) -> Camera {
    let centre = min * 0.5 + max * 0.5;
    let radius = (max * 0.5 - min * 0.5).length().max(f32::MIN_POSITIVE);
    // The ball around the box would just fit at 1 / sin(fov / 2); most meshes leave its rim empty.
    let distance = 0.8 * radius / (OUTSIDE_FOV * 0.5).sin();
    let from = Vec3::new(0.45, 0.35, 1.0).normalize();
    Camera::look_at(centre + from * distance, centre, OUTSIDE_FOV)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes;

    #[test]
    fn the_middle_of_the_picture_is_the_target() {
        let camera = Camera::look_at([1.0, 2.0, 3.0], [4.0, -2.0, 3.0], 1.0);
        let (origin, direction) = camera.ray(50, 50, 101, 101);
        assert_eq!(origin, [1.0, 2.0, 3.0]);
        let want = Vec3::new(0.6, -0.8, 0.0);
        assert!(Vec3::from(direction).distance(want) < 1e-6);
    }

    #[test]
    fn the_top_and_the_right_are_where_they_should_be() {
        let camera = Camera::look_at([0.0; 3], [0.0, 0.0, -1.0], std::f32::consts::FRAC_PI_2);
        let (_, corner) = camera.ray_through(200.0, 0.0, 200, 100);
        let want = Vec3::new(2.0, 1.0, -1.0).normalize();
        assert!(Vec3::from(corner).distance(want) < 1e-6);
    }

    #[test]
    fn straight_down_and_nowhere_still_give_finite_rays() {
        for target in [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]] {
            let (_, direction) = Camera::look_at([0.0; 3], target, 1.0).ray(0, 0, 3, 2);
            assert!((Vec3::from(direction).length() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn known_scenes_have_their_views() {
        let mut mesh = shapes::cuboid([-1.0; 3], [1.0; 3]);
        assert_eq!(cameras_for(&mesh).len(), 1);
        let eye = Vec3::from(cameras_for(&mesh)[0].eye());
        assert!(eye.abs().max_element() > 1.0);
        mesh.name = "kitchen".into();
        let inside = cameras_for(&mesh);
        assert_eq!(inside.len(), 4);
        assert!((inside[0].eye()[1] + 1.0 / 3.0).abs() < 1e-6);
        assert_eq!(cameras_for(&Mesh::default()).len(), 1);
    }
}
