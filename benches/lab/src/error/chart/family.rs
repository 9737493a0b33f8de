//! Which variants belong together, and how they are marked.

use super::labels::Point;
use super::{Area, Outcome};
use crate::error::kernels;
use plotters::prelude::*;

/// What belongs together has one colour and one marker.
pub struct Family {
    pub name: &'static str,
    /// What the variants' names begin with.
    prefix: &'static str,
    pub colour: RGBColor,
    marker: Marker,
}

#[derive(Clone, Copy)]
enum Marker {
    Disc,
    Square,
    Triangle,
}

/// Colours after Okabe and Ito, to be told apart by everyone.
const FAMILIES: [Family; 7] = [
    Family {
        name: "wide-bvh",
        prefix: "wide-bvh ",
        colour: RGBColor(213, 94, 0),
        marker: Marker::Disc,
    },
    Family {
        name: "Embree",
        prefix: "embree ",
        colour: RGBColor(0, 114, 178),
        marker: Marker::Disc,
    },
    Family {
        name: "obvhs",
        prefix: "obvhs ",
        colour: RGBColor(204, 121, 167),
        marker: Marker::Disc,
    },
    Family {
        name: "parry3d",
        prefix: "parry3d",
        colour: RGBColor(230, 159, 0),
        marker: Marker::Disc,
    },
    Family {
        name: "bvh",
        prefix: "bvh",
        colour: RGBColor(86, 180, 233),
        marker: Marker::Disc,
    },
    Family {
        name: "box tests, in one plain traversal",
        prefix: kernels::SLAB,
        colour: RGBColor(90, 90, 90),
        marker: Marker::Square,
    },
    Family {
        name: "triangle tests, in the same",
        prefix: kernels::TRIANGLE,
        colour: RGBColor(0, 158, 115),
        marker: Marker::Triangle,
    },
];

/// Of what is in no family: a layout, a packet or a batch that came later and wants one.
const NO_FAMILY: Family = Family {
    name: "other",
    prefix: "",
    colour: BLACK,
    marker: Marker::Disc,
};

/// The family of a variant.
pub fn family(variant: &str) -> &'static Family {
    let is = |family: &&Family| variant.starts_with(family.prefix);
    FAMILIES.iter().find(is).unwrap_or(&NO_FAMILY)
}

/// Every family, in the legend's order.
pub fn all() -> impl Iterator<Item = &'static Family> {
    FAMILIES.iter().chain([&NO_FAMILY])
}

/// Draws a family's marker.
pub fn marker(area: &Area<'_>, [x, y]: Point, family: &Family) -> Outcome {
    let (x, y) = (x.round() as i32, y.round() as i32);
    let fill = family.colour.mix(0.9).filled();
    match family.marker {
        Marker::Disc => area.draw(&Circle::new((x, y), 5, fill))?,
        Marker::Square => area.draw(&Rectangle::new([(x - 4, y - 4), (x + 4, y + 4)], fill))?,
        Marker::Triangle => {
            let corners = [(x, y - 6), (x + 6, y + 5), (x - 6, y + 5)];
            area.draw(&Polygon::new(corners, fill))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_variant_has_its_family() {
        assert_eq!(family("wide-bvh 8 avx2").name, "wide-bvh");
        assert_eq!(family("bvh").name, "bvh");
        assert_eq!(family("slab Ize").prefix, kernels::SLAB);
        assert_eq!(family("a new one").name, "other");
    }
}
