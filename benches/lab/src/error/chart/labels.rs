//! Where the labels of a chart's points go: beside them, over nothing else.

/// A place in pixels, y downwards.
pub type Point = [f64; 2];

/// An upright rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    pub min: Point,
    pub max: Point,
}

impl Rect {
    fn around(center: Point, size: Point) -> Self {
        let half = size.map(|side| side / 2.0);
        Self {
            min: [center[0] - half[0], center[1] - half[1]],
            max: [center[0] + half[0], center[1] + half[1]],
        }
    }

    fn grown(&self, by: f64) -> Self {
        Self {
            min: self.min.map(|x| x - by),
            max: self.max.map(|x| x + by),
        }
    }

    fn overlaps(&self, other: &Self) -> bool {
        (0..2).all(|axis| self.min[axis] < other.max[axis] && other.min[axis] < self.max[axis])
    }

    fn is_within(&self, other: &Self) -> bool {
        (0..2).all(|axis| other.min[axis] <= self.min[axis] && self.max[axis] <= other.max[axis])
    }

    fn clamp(&self, point: Point) -> Point {
        [0, 1].map(|axis| point[axis].clamp(self.min[axis], self.max[axis]))
    }

    /// Whether a line passes it, by points two pixels apart.
    fn meets(&self, [from, to]: [Point; 2]) -> bool {
        let length = (to[0] - from[0]).hypot(to[1] - from[1]);
        let steps = (length / 2.0).ceil().max(1.0);
        (0..=steps as u32).any(|step| {
            let part = f64::from(step) / steps;
            let point = [0, 1].map(|axis| from[axis] + part * (to[axis] - from[axis]));
            self.clamp(point) == point
        })
    }
}

/// A label's place, and the line to it if it is not right beside its point.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    pub rect: Rect,
    pub leader: Option<[Point; 2]>,
}

/// Half the side of a point's marker, and some room.
const MARKER: f64 = 8.0;
/// From here on a label has a line to its point.
const BESIDE: f64 = 13.0;
/// How often each label is placed anew.
const PASSES: usize = 8;

/// A place within `area` for the label of each of `points`, of these sizes, the nearest that is free of
/// markers and other labels and, if at all possible, of their lines and of `lines`. `None` where there is no room left.
pub fn place(
    points: &[Point],
    sizes: &[Point],
    area: Rect,
    lines: &[[Point; 2]],
) -> Vec<Option<Placed>> {
    let markers: Vec<Rect> = points
        .iter()
        .map(|&point| Rect::around(point, [2.0 * MARKER; 2]))
        .collect();
    let mut placed: Vec<Option<Placed>> = vec![None; points.len()];
    // Those placed later may have closed a better place for those before, or left one.
    for _ in 0..PASSES {
        for i in 0..points.len() {
            placed[i] = None;
            let mut best: Option<(f64, Placed)> = None;
            for candidate in candidates(points[i], sizes[i]) {
                let Some(cost) = cost(i, &candidate, &markers, &placed, area, lines) else {
                    continue;
                };
                if best.is_none_or(|(least, _)| cost < least) {
                    best = Some((cost, candidate));
                }
            }
            placed[i] = best.map(|(_, candidate)| candidate);
        }
    }
    placed
}

/// Places around a point, on rings.
fn candidates(point: Point, size: Point) -> impl Iterator<Item = Placed> {
    const DIRECTIONS: u32 = 32;
    let rings = (0..24).map(|ring| 10.0 + 8.0 * f64::from(ring));
    rings.flat_map(move |radius| {
        (0..DIRECTIONS).map(move |i| {
            let (sin, cos) =
                (f64::from(i) / f64::from(DIRECTIONS) * std::f64::consts::TAU).sin_cos();
            let center = [
                point[0] + cos * (radius + size[0] / 2.0),
                point[1] + sin * (radius + size[1] / 2.0),
            ];
            let rect = Rect::around(center, size);
            let end = rect.clamp(point);
            let distance = (end[0] - point[0]).hypot(end[1] - point[1]);
            let leader = (distance > BESIDE).then_some([point, end]);
            Placed { rect, leader }
        })
    })
}

/// The less the better; `None` if it is no place at all.
fn cost(
    label: usize,
    candidate: &Placed,
    markers: &[Rect],
    placed: &[Option<Placed>],
    area: Rect,
    lines: &[[Point; 2]],
) -> Option<f64> {
    let Placed { rect, leader } = candidate;
    let others = || placed.iter().flatten();
    let blocked = !rect.is_within(&area)
        || markers.iter().any(|marker| rect.overlaps(marker))
        || others().any(|other| rect.overlaps(&other.rect));
    if blocked {
        return None;
    }
    let count = |bad: &dyn Fn(&&Placed) -> bool| others().filter(bad).count() as f64;
    let mut cost = 200.0 * count(&|other| other.leader.is_some_and(|line| rect.meets(line)));
    if let Some(line) = *leader {
        let [from, to] = line;
        cost += 10.0 + (to[0] - from[0]).hypot(to[1] - from[1]);
        cost += 200.0 * count(&|other| other.rect.meets(line));
        cost += 100.0 * count(&|other| other.leader.is_some_and(|other| cross(line, other)));
    }
    for (other, marker) in markers.iter().enumerate() {
        if other == label {
            continue;
        }
        match leader {
            Some(line) if marker.meets(*line) => cost += 100.0,
            // Right beside another's marker, it would be taken for that one's.
            None if rect.grown(BESIDE - MARKER).overlaps(marker) => cost += 100.0,
            _ => {}
        }
    }
    cost += 120.0 * lines.iter().filter(|&&line| rect.meets(line)).count() as f64;
    Some(cost)
}

/// Whether two lines cross.
fn cross([a, b]: [Point; 2], [c, d]: [Point; 2]) -> bool {
    let side = |p: Point, q: Point, r: Point| {
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]) > 0.0
    };
    side(a, b, c) != side(a, b, d) && side(c, d, a) != side(c, d, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_a_crowd_overlap_nothing() {
        let mut rng = fastrand::Rng::with_seed(9);
        let points: Vec<Point> = (0..20)
            .map(|_| [200.0 + 200.0 * rng.f64(), 150.0 + 60.0 * rng.f64()])
            .collect();
        let sizes = vec![[110.0, 14.0]; points.len()];
        let area = Rect {
            min: [0.0; 2],
            max: [700.0, 400.0],
        };
        let labels: Vec<Rect> = place(&points, &sizes, area, &[])
            .into_iter()
            .map(|placed| placed.expect("there is room").rect)
            .collect();
        for (i, label) in labels.iter().enumerate() {
            assert!(label.is_within(&area));
            assert!(labels[..i].iter().all(|other| !other.overlaps(label)));
            assert!(points.iter().all(|&point| label.clamp(point) != point));
        }
    }

    #[test]
    fn lines_cross_or_do_not() {
        let diagonal = [[0.0, 0.0], [2.0, 2.0]];
        assert!(cross(diagonal, [[0.0, 2.0], [2.0, 0.0]]));
        assert!(!cross(diagonal, [[3.0, 0.0], [3.0, 4.0]]));
    }
}
