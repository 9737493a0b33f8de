//! Pictures of light: sun and sky, a lamp where neither shines, and bare ambient occlusion.

use crate::{
    args::Args,
    picture::Picture,
    sampling::Samples,
    trace,
    world::{Surface, Tracer, World},
};
use glam::Vec3;
use wide_bvh::geometry::Ray;
use wide_bvh_scenes::Camera;

/// Rays that look around from each point seen.
const AROUND: u32 = 6;
/// The share of light that a surface gives back.
const ALBEDO: Vec3 = Vec3::new(0.58, 0.54, 0.49);
/// How bright the sun is, where it falls straight.
const SUN: Vec3 = Vec3::new(2.5, 2.05, 1.5);
/// Towards the sun.
const TO_SUN: Vec3 = Vec3::new(-0.72, 0.62, 0.32);
/// What comes from other surfaces: the light of the second and later bounces, as if even.
const BOUNCED: Vec3 = Vec3::new(0.24, 0.21, 0.18);
/// How bright a lamp in a closed room is.
const LAMP: Vec3 = Vec3::new(1.15, 1.0, 0.8);
/// The light of a closed room from everywhere.
const ROOM: Vec3 = Vec3::new(0.34, 0.38, 0.44);
/// What counts as near for occlusion, in diagonals of the scene's bounds.
const NEAR: f32 = 0.2;
/// Behind a mesh that is shown by its occlusion alone.
const BACKDROP: Vec3 = Vec3::new(0.22, 0.24, 0.28);

/// Sun with shadows and a sky; in a room, where neither would be seen, a lamp.
pub fn shaded(world: &World<'_>, camera: &Camera, args: &Args) -> Picture {
    let light = Light::of(world, camera);
    let light_along = |tracer: &mut Tracer<'_>, ray: &Ray, samples: &mut Samples| {
        let light = match (tracer.closest(ray), &light) {
            (None, _) => sky(ray.direction),
            (Some(surface), Light::Sun) => outdoors(tracer, ray, &surface, samples),
            (Some(surface), &Light::Lamp(lamp)) => indoors(tracer, lamp, &surface, samples),
        };
        // Before the mean over a pixel: edges against the bright sky stay smooth.
        film(light)
    };
    render(world, camera, args, light_along, srgb)
}

/// How much of what is around a point is free: white where nothing is near.
pub fn ambient_occlusion(world: &World<'_>, camera: &Camera, args: &Args) -> Picture {
    let open_part = |tracer: &mut Tracer<'_>, ray: &Ray, samples: &mut Samples| {
        tracer.closest(ray).map_or(BACKDROP, |surface| {
            Vec3::splat(openness(tracer, &surface, samples, 2 * AROUND))
        })
    };
    // A share, not light: the bytes are the shares themselves.
    render(world, camera, args, open_part, bytes)
}

/// What lights a scene.
enum Light {
    /// The sun and the sky.
    Sun,
    /// A lamp at this place, and what walls throw back.
    Lamp(Vec3),
}

impl Light {
    /// A lamp if next to nothing of the sky is to be seen from the camera.
    fn of(world: &World<'_>, camera: &Camera) -> Self {
        const LOOKS: u32 = 256;
        let mut tracer = Tracer { world, rays: 0 };
        let mut samples = Samples::for_pixel(0, 0);
        let eye = Vec3::from(camera.eye());
        let blocked = (0..LOOKS)
            .filter(|_| tracer.blocked(&Ray::new(eye, samples.around(Vec3::Y))))
            .count();
        if (blocked as u32) < LOOKS * 95 / 100 {
            return Self::Sun;
        }
        // Under the ceiling and to one side, so that things cast shadows that the camera sees.
        let mut lamp = eye;
        for way in [Vec3::Y, Vec3::new(0.8, 0.0, 0.6)] {
            let free = tracer.closest(&Ray::new(lamp, way));
            lamp += 0.6 * free.map_or(0.0, |surface| surface.distance) * way;
        }
        Self::Lamp(lamp)
    }
}

/// The mean of `samples` rays through each pixel.
fn render(
    world: &World<'_>,
    camera: &Camera,
    args: &Args,
    along: impl Fn(&mut Tracer<'_>, &Ray, &mut Samples) -> Vec3 + Sync,
    encode: impl Fn(Vec3) -> [u8; 3] + Sync,
) -> Picture {
    let (width, height) = (args.width, args.height);
    let colours = trace::pixels(world, args, |tracer, x, y| {
        let mut samples = Samples::for_pixel(x, y);
        let mut within = Samples::for_pixel(0, 0);
        let mut sum = Vec3::ZERO;
        for _ in 0..args.samples {
            let [dx, dy] = within.point();
            let (x, y) = (x as f32 + dx, y as f32 + dy);
            let (origin, direction) = camera.ray_through(x, y, width, height);
            sum += along(tracer, &Ray::new(origin, direction), &mut samples);
        }
        encode(sum / args.samples as f32)
    });
    Picture {
        width,
        height,
        colours,
    }
}

fn outdoors(tracer: &mut Tracer<'_>, ray: &Ray, surface: &Surface, samples: &mut Samples) -> Vec3 {
    let to_sun = TO_SUN.normalize();
    let slant = surface.normal.dot(to_sun);
    let mut light = Vec3::ZERO;
    if slant > 0.0 && !tracer.blocked(&Ray::new(surface.point, to_sun)) {
        light += slant * SUN;
    }
    for _ in 0..AROUND {
        let way = samples.around(surface.normal);
        let free = !tracer.blocked(&Ray::new(surface.point, way));
        light += if free { sky(way) } else { BOUNCED } / AROUND as f32;
    }
    // The air takes on the colour of the horizon with distance.
    let air = tracer.world.depth(ray, surface.distance) / tracer.world.size;
    let clear = (-(0.9 * air).powi(2)).exp();
    sky(ray.direction.with_y(0.0)).lerp(ALBEDO * light, clear)
}

fn indoors(tracer: &mut Tracer<'_>, lamp: Vec3, surface: &Surface, samples: &mut Samples) -> Vec3 {
    let slant = surface
        .normal
        .dot((lamp - surface.point).normalize_or_zero());
    let mut light = ROOM * openness(tracer, surface, samples, AROUND);
    if slant > 0.0 && !tracer.blocked(&Ray::segment(surface.point, lamp)) {
        light += slant * LAMP;
    }
    ALBEDO * light
}

/// The share of `rays` around a point that meet nothing near.
fn openness(tracer: &mut Tracer<'_>, surface: &Surface, samples: &mut Samples, rays: u32) -> f32 {
    let near = NEAR * tracer.world.size;
    let free = |_: &u32| {
        let way = samples.around(surface.normal);
        !tracer.blocked(&Ray::segment(surface.point, surface.point + near * way))
    };
    (0..rays).filter(free).count() as f32 / rays as f32
}

/// The light of the sky from a direction: pale at the horizon, blue above, dull below.
fn sky(way: Vec3) -> Vec3 {
    const ZENITH: Vec3 = Vec3::new(0.26, 0.46, 0.86);
    const HORIZON: Vec3 = Vec3::new(0.70, 0.78, 0.88);
    const GROUND: Vec3 = Vec3::new(0.38, 0.36, 0.34);
    let height = way.normalize_or_zero().y;
    if height > 0.0 {
        HORIZON.lerp(ZENITH, height.sqrt())
    } else {
        HORIZON.lerp(GROUND, (-4.0 * height).min(1.0))
    }
}

/// Light without bound to between 0 and 1, as film does: Narkowicz's fit (2016) of the ACES curve.
fn film(light: Vec3) -> Vec3 {
    let x = 0.6 * light;
    (x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)).clamp(Vec3::ZERO, Vec3::ONE)
}

/// Linear light to the bytes that a screen expects (IEC 61966-2-1).
fn srgb(light: Vec3) -> [u8; 3] {
    let encode = |x: f32| match x <= 0.003_130_8 {
        true => 12.92 * x,
        false => 1.055 * x.powf(1.0 / 2.4) - 0.055,
    };
    bytes(Vec3::from(light.to_array().map(encode)))
}

/// Shares of 1 as shares of 255.
fn bytes(shares: Vec3) -> [u8; 3] {
    shares.to_array().map(|x| (255.0 * x).round() as u8)
}
