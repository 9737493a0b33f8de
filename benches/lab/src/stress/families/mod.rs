//! The families: what is hostile about each, and how its cases are made.

mod aligned;
mod closed;
mod crowded;
mod meshes;
mod range;
mod slender;
mod worst;

use super::case::Case;
use fastrand::Rng;

/// A kind of case.
pub struct Family {
    pub name: &'static str,
    /// What is hostile about it.
    pub about: &'static str,
    /// It needs denormals to be flushed to zero.
    pub flushes: bool,
    /// One number in so many makes a case, where cases take much longer than others.
    pub every: u64,
    pub case: fn(&mut Rng) -> Case,
}

const fn family(name: &'static str, about: &'static str, case: fn(&mut Rng) -> Case) -> Family {
    Family {
        name,
        about,
        flushes: false,
        every: 1,
        case,
    }
}

/// A family of large cases, or that are searched for.
const fn slow_family(
    name: &'static str,
    about: &'static str,
    case: fn(&mut Rng) -> Case,
) -> Family {
    Family {
        every: 4,
        ..family(name, about, case)
    }
}

/// All of them.
pub const FAMILIES: &[Family] = &[
    family("any", "meshes of all kinds, rays of all kinds", range::any),
    family("scale", "the same at 1e-18 to 1e18", range::scale),
    family(
        "offset",
        "moved up to 1e8 extents from the origin",
        range::offset,
    ),
    family("far", "rays from up to 1e8 extents away", range::far),
    family(
        "directions",
        "directions from denormal to huge, components next to zero",
        range::directions,
    ),
    family(
        "bits",
        "coordinates and rays of any bits, NaN and infinity too",
        range::bits,
    ),
    Family {
        flushes: true,
        ..family(
            "flush",
            "denormals, flushed to zero by the host program",
            range::flush,
        )
    },
    family(
        "needles",
        "needles and slivers of aspect up to 1e7",
        slender::needles,
    ),
    family(
        "grazing",
        "rays down to 1e-7 radians from a triangle's plane",
        slender::grazing,
    ),
    family(
        "axes",
        "rays along axes and in the planes of boxes",
        aligned::axes,
    ),
    family(
        "quantised",
        "small whole coordinates, edges and vertices met exactly",
        aligned::quantised,
    ),
    family(
        "surface",
        "rays that start on faces, edges and vertices",
        aligned::surface,
    ),
    family(
        "boxes",
        "rays at corners, edges and faces of boxes, from far and along diagonals",
        aligned::boxes,
    ),
    family(
        "closed",
        "at vertices and edges of closed meshes from inside: none may get out",
        closed::closed,
    ),
    family(
        "trees",
        "deep and unbalanced trees, chains of thousands",
        crowded::trees,
    ),
    slow_family(
        "coincident",
        "thousands of triangles in the same place",
        crowded::coincident,
    ),
    family("dust", "one giant triangle among dust", crowded::dust),
    slow_family(
        "pieces",
        "long triangles across one another, cut by the builder",
        crowded::pieces,
    ),
    family(
        "mixed",
        "all of it at once: scaled, moved, squashed, any direction",
        range::mixed,
    ),
    slow_family(
        "worst-t",
        "rays that were searched for a large error of t",
        worst::t,
    ),
    slow_family(
        "worst-shear",
        "rays that were searched for a large error of the shear",
        worst::shear,
    ),
    slow_family(
        "worst-slab",
        "rays that were searched for a large error of the box test",
        worst::slab,
    ),
];
