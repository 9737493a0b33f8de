//! The chart: time across, error up, both logarithmic; the less the better.

mod axis;
mod family;
mod labels;

use super::{kernels, record::Figures, statistics::pareto_front};
use axis::{ErrorScale, plain, power, time_axis};
use family::{family, marker};
use labels::{Placed, Point, Rect};
use plotters::{
    coord::Shift,
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};
use std::error::Error;

/// One variant's place in a panel.
pub struct Dot {
    pub variant: String,
    /// Nanoseconds a ray.
    pub time: f64,
    /// 0 has a line of its own.
    pub error: f64,
}

/// Wrong answers of each variant, in a million rays.
pub fn wrong_answers(rows: &[(String, Figures)]) -> Vec<Dot> {
    dots(rows, |figures| {
        let wrong = figures.counts.lost + figures.counts.phantoms;
        Some(wrong as f64 * 1e6 / figures.counts.rays as f64)
    })
}

/// The 99.9th percentile of each variant's relative error of `t`.
pub fn errors_of_t(rows: &[(String, Figures)]) -> Vec<Dot> {
    dots(rows, |figures| {
        figures.t_relative.map(|spread| spread.p99_9)
    })
}

fn dots(rows: &[(String, Figures)], error: impl Fn(&Figures) -> Option<f64>) -> Vec<Dot> {
    let dot = |(variant, figures): &(String, Figures)| {
        Some(Dot {
            variant: variant.clone(),
            time: figures.ns_per_ray,
            error: error(figures)?,
        })
    };
    rows.iter().filter_map(dot).collect()
}

const WIDTH: u32 = 1000;
const HEADER: u32 = 66;
const PANELS: [u32; 2] = [600, 420];
const FONT: &str = "sans-serif";
/// In pixels; plotters' SVG makes fonts smaller by 1.24.
const TEXT: f64 = 11.5;
const LINE: f64 = 15.0;
const INK: RGBColor = RGBColor(40, 40, 40);
const FAINT: RGBColor = RGBColor(228, 228, 228);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Outcome<T = ()> = Result<T, Box<dyn Error>>;

fn text(size: f64) -> TextStyle<'static> {
    (FONT, size * 1.24).into_font().color(&INK)
}

/// The two panels as an SVG.
///
/// # Errors
/// It cannot be drawn.
pub fn draw(wrong: &[Dot], t: &[Dot]) -> Outcome<String> {
    let mut svg = String::new();
    {
        let height = HEADER + PANELS.iter().sum::<u32>();
        let root = SVGBackend::with_string(&mut svg, (WIDTH, height)).into_drawing_area();
        root.fill(&WHITE)?;
        let (header, panels) = root.split_vertically(HEADER);
        let (upper, lower) = panels.split_vertically(PANELS[0]);
        legend(&header, wrong)?;
        panel(
            &upper,
            wrong,
            "wrong answers in a million rays, all sets of rays",
            plain,
        )?;
        panel(
            &lower,
            t,
            "relative error of t, 99.9th percentile, scenes' own rays",
            power,
        )?;
        root.present()?;
    }
    Ok(svg)
}

fn legend(area: &Area<'_>, dots: &[Dot]) -> Outcome {
    let style = text(12.0).pos(Pos::new(HPos::Left, VPos::Center));
    area.draw(&Text::new(
        "Run time against error: towards the lower left is better",
        (84, 18),
        text(15.0).pos(Pos::new(HPos::Left, VPos::Center)),
    ))?;
    let mut x = 90;
    for family in family::all() {
        let is_one = |dot: &Dot| family::family(&dot.variant).name == family.name;
        if !dots.iter().any(is_one) {
            continue;
        }
        marker(area, [f64::from(x), 46.0], family)?;
        area.draw(&Text::new(family.name, (x + 11, 46), style.clone()))?;
        x += 11 + (family.name.len() as f64 * 5.9) as i32 + 27;
    }
    area.draw(&PathElement::new([(x, 46), (x + 24, 46)], front_style()))?;
    area.draw(&Text::new("Pareto front", (x + 30, 46), style))?;
    Ok(())
}

fn front_style() -> ShapeStyle {
    BLACK.mix(0.4).stroke_width(3)
}

fn panel(area: &Area<'_>, dots: &[Dot], title: &str, number: fn(f64) -> String) -> Outcome {
    if dots.is_empty() {
        return Ok(());
    }
    let scale = ErrorScale::new(dots);
    let mut chart = ChartBuilder::on(area)
        .margin_right(16)
        .margin_left(6)
        .margin_top(8)
        .x_label_area_size(44)
        .y_label_area_size(78)
        .build_cartesian_2d(time_axis(dots), scale.axis())?;
    chart
        .configure_mesh()
        .bold_line_style(FAINT)
        .light_line_style(TRANSPARENT)
        .axis_style(INK)
        .label_style(text(12.0))
        .axis_desc_style(text(13.0))
        .x_desc("nanoseconds a ray, one thread")
        .y_desc(title)
        .x_label_formatter(&|&x| plain(x))
        .y_label_formatter(&|&y| {
            if scale.zero == Some(y) {
                "0".to_owned()
            } else {
                number(y)
            }
        })
        .draw()?;
    let (xs, ys) = chart.plotting_area().get_pixel_range();
    let (left, top) = area.get_base_pixel();
    let pixel = |x: f64, y: f64| -> Point {
        let (x, y) = chart.backend_coord(&(x, y));
        [f64::from(x - left), f64::from(y - top)]
    };
    let at = |dot: &Dot| pixel(dot.time.log10(), scale.y(dot.error));
    let room = Rect {
        min: [
            f64::from(xs.start - left) + 4.0,
            f64::from(ys.start - top) + 4.0,
        ],
        max: [
            f64::from(xs.end - left) - 4.0,
            f64::from(ys.end - top) - 4.0,
        ],
    };

    let points: Vec<Point> = dots.iter().map(at).collect();
    if let Some(zero) = scale.zero {
        let [_, y] = pixel(dots[0].time.log10(), zero);
        let ends = [room.min[0] - 4.0, room.max[0] + 4.0].map(|x| (x as i32, y as i32));
        area.draw(&PathElement::new(ends, INK.mix(0.35).stroke_width(1)))?;
    }
    let front = front(dots, &points, room);
    let path: Vec<(i32, i32)> = front.iter().map(|&p| rounded(p)).collect();
    area.draw(&PathElement::new(path, front_style()))?;
    let lines: Vec<[Point; 2]> = front.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    for (dot, point) in dots.iter().zip(&points) {
        marker(area, *point, family(&dot.variant))?;
    }
    let names: Vec<&str> = dots.iter().map(|dot| label(&dot.variant)).collect();
    let sizes: Vec<Point> = names.iter().map(|name| size(name)).collect();
    let placed = labels::place(&points, &sizes, room, &lines);
    for ((dot, name), placed) in dots.iter().zip(names).zip(placed) {
        if let Some(placed) = placed {
            write_label(area, name, family(&dot.variant).colour, &placed)?;
        }
    }
    Ok(())
}

/// The Pareto front as a staircase, from the top to the right.
fn front(dots: &[Dot], points: &[Point], room: Rect) -> Vec<Point> {
    let values: Vec<[f64; 2]> = dots.iter().map(|dot| [dot.time, dot.error]).collect();
    let mut stairs: Vec<Point> = Vec::new();
    for dot in pareto_front(&values) {
        let [x, y] = points[dot];
        let above = stairs.last().map_or(room.min[1], |last| last[1]);
        stairs.extend([[x, above], [x, y]]);
    }
    if let Some(&[_, y]) = stairs.last() {
        stairs.push([room.max[0] + 4.0, y]);
    }
    stairs
}

/// A variant's name without what its family's marker says.
fn label(variant: &str) -> &str {
    let lab = variant
        .strip_prefix(kernels::SLAB)
        .or_else(|| variant.strip_prefix(kernels::TRIANGLE));
    lab.unwrap_or(variant)
}

/// About how large a label is.
fn size(name: &str) -> Point {
    [name.chars().count() as f64 * TEXT * 0.56 + 4.0, LINE]
}

fn write_label(area: &Area<'_>, name: &str, colour: RGBColor, placed: &Placed) -> Outcome {
    if let Some([from, to]) = placed.leader {
        let line = [rounded(from), rounded(to)];
        area.draw(&PathElement::new(line, colour.mix(0.6).stroke_width(1)))?;
    }
    let Rect { min, max } = placed.rect;
    let center = rounded([(min[0] + max[0]) / 2.0, (min[1] + max[1]) / 2.0]);
    let colour = dark(colour);
    let style = text(TEXT)
        .color(&colour)
        .pos(Pos::new(HPos::Center, VPos::Center));
    area.draw(&Text::new(name.to_owned(), center, style))?;
    Ok(())
}

/// Dark enough to read.
fn dark(RGBColor(r, g, b): RGBColor) -> RGBColor {
    let [r, g, b] = [r, g, b].map(|x| (f64::from(x) * 0.7) as u8);
    RGBColor(r, g, b)
}

fn rounded([x, y]: Point) -> (i32, i32) {
    (x.round() as i32, y.round() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variant_is_named_in_both_panels() {
        let dots = |errors: [f64; 3]| {
            let names = ["wide-bvh 8 avx2", "embree HIGH", "slab Ize"];
            let dot = |(i, variant): (usize, &str)| Dot {
                variant: variant.to_owned(),
                time: 100.0 * (i + 1) as f64,
                error: errors[i],
            };
            names.into_iter().enumerate().map(dot).collect::<Vec<_>>()
        };
        let svg = draw(&dots([0.0, 3.0, 2e4]), &dots([1e-7, 2e-7, 1e-3])).unwrap();
        for name in ["wide-bvh 8 avx2", "embree HIGH", "Ize"] {
            assert_eq!(
                svg.lines().filter(|line| line.trim() == name).count(),
                2,
                "{name}"
            );
        }
        assert!(svg.lines().any(|line| line.trim() == "10,000"));
        assert!(svg.lines().any(|line| line.trim() == "0"));
    }
}
