//! Binary trees of any shape, and what are none, into the collapse: an error that is true, or a hierarchy that answers as
//! the reference does.
#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use wide_bvh::{
    build::{BinaryNode, BinaryTree, BuildError, TreeError},
    geometry::Aabb,
    layout::{Node4, Node8},
    primitive::Cuboids,
};
use wide_bvh_fuzz::{
    BoxBytes, Float, Mesh, MeshBytes, RayBytes, Settings, Width, assert_all, boxes, corners,
    first_not_finite, floats, of_boxes, of_mesh, rays,
};

#[derive(Arbitrary, Debug)]
struct Input {
    settings: Settings,
    wide: bool,
    primitives: Primitives,
    shape: Shape,
    edits: Vec<Edit>,
    /// What leaves list, over and over; then what they have not listed.
    listed: Vec<u8>,
    /// Without what they have not.
    listed_alone: bool,
    aabb: [Float; 6],
    rays: Vec<RayBytes>,
}

#[derive(Arbitrary, Debug)]
enum Primitives {
    Triangles(MeshBytes),
    Boxes(Vec<BoxBytes>),
}

#[derive(Arbitrary, Debug)]
enum Shape {
    /// What leads where: `first` and `count`.
    Raw(Vec<(u8, u8)>),
    /// From a leaf: each byte splits one of those there are. Then how many primitives each leaf has.
    Grown(Vec<u8>, Vec<u8>),
    /// Each level a leaf, on this side or that, and the rest.
    Chain { levels: u16, sides: u8 },
}

/// A node that is changed.
#[derive(Arbitrary, Debug)]
struct Edit {
    node: u16,
    first: Option<u32>,
    count: Option<u32>,
}

fuzz_target!(|input: Input| {
    match input.wide {
        true => check::<Node8>(&input),
        false => check::<Node4>(&input),
    }
});

fn check<N: Width>(input: &Input) {
    match &input.primitives {
        Primitives::Triangles(bytes) => {
            let mesh = bytes.mesh();
            if let Some(tree) = tree(input, mesh.indices.len()) {
                triangles::<N>(input, &mesh, &tree);
            }
        }
        Primitives::Boxes(bytes) => {
            let boxes = boxes(bytes, 1);
            if let Some(tree) = tree(input, boxes.len()) {
                primitives::<N>(input, &boxes, &tree);
            }
        }
    }
}

/// The tree, if it is one.
fn tree(input: &Input, primitives: usize) -> Option<BinaryTree> {
    let [a, b, c, d, e, f] = floats(input.aabb);
    let aabb = Aabb::new([a, b, c].into(), [d, e, f].into());
    let mut links = input.shape.links();
    for &Edit { node, first, count } in &input.edits {
        let nodes = links.len().max(1);
        if let Some(link) = links.get_mut(usize::from(node) % nodes) {
            *link = (first.unwrap_or(link.0), count.unwrap_or(link.1));
        }
    }
    let node = |&(first, count): &(u32, u32)| BinaryNode { aabb, first, count };
    let nodes: Vec<BinaryNode> = links.iter().map(node).collect();
    let order = order(input, &mut links, primitives);
    let expected = is_tree(&nodes, order.len());
    match BinaryTree::new(nodes.clone(), order) {
        Ok(tree) => {
            assert!(expected, "{tree:?}");
            Some(tree)
        }
        Err(error) => {
            assert!(!expected, "{error}");
            assert!(is_true(error, &nodes), "{error}");
            None
        }
    }
}

impl Shape {
    /// `first` and `count` of every node; leaves' places are one after the other but for raw shapes.
    fn links(&self) -> Vec<(u32, u32)> {
        match self {
            Self::Raw(links) => links
                .iter()
                .map(|&(first, count)| (first.into(), count.into()))
                .collect(),
            Self::Grown(splits, counts) => {
                let (mut links, mut leaves) = (vec![(0, 1)], vec![0]);
                for &split in splits {
                    let node = leaves.swap_remove(usize::from(split) % leaves.len());
                    let first = links.len();
                    links[node] = (first as u32, 0);
                    links.extend([(0, 1); 2]);
                    leaves.extend([first, first + 1]);
                }
                let mut place = 0;
                let mut counts = counts.iter();
                for (first, count) in links.iter_mut().filter(|link| link.1 > 0) {
                    *count = counts
                        .next()
                        .map_or(1, |&count| u32::from(count % 16).max(1));
                    *first = place;
                    place += *count;
                }
                links
            }
            &Self::Chain { levels, sides } => {
                let levels = u32::from(levels % 8192);
                let mut links = vec![(1, 0)];
                for level in 0..levels {
                    let children = [(level, 1), (2 * level + 3, 0)];
                    match sides >> (level % 8) & 1 {
                        0 => links.extend(children),
                        _ => {
                            links.extend([children[1], children[0]]);
                        }
                    }
                }
                // Nodes of the chain that are last have the places after it.
                close(links, levels)
            }
        }
    }
}

/// Inner nodes that lead past the end are leaves of one.
fn close(mut links: Vec<(u32, u32)>, mut place: u32) -> Vec<(u32, u32)> {
    let nodes = links.len() as u32;
    for (first, count) in &mut links {
        if *count == 0 && *first + 2 > nodes {
            (*first, *count) = (place, 1);
            place += 1;
        }
    }
    links
}

/// What leaves list: as much as they have places for, and in the end all primitives, if there is to be a tree over them.
fn order(input: &Input, links: &mut [(u32, u32)], primitives: usize) -> Vec<u32> {
    let places = links.iter().filter(|link| link.1 > 0);
    let places = places
        .map(|link| u64::from(link.0) + u64::from(link.1))
        .max();
    let places = places.unwrap_or(0).min(20_000) as usize;
    let listed = |place: usize| match input.listed.as_slice() {
        [] if primitives > 0 => (place % primitives) as u32,
        [] => 0,
        listed => listed[place % listed.len()].into(),
    };
    let order: Vec<u32> = (0..places).map(listed).collect();
    if input.listed_alone {
        return order;
    }
    // The last places are those of what is not listed yet.
    let missing = (0..primitives as u32).filter(|primitive| !order.contains(primitive));
    let missing: Vec<u32> = missing.collect();
    let kept = places.saturating_sub(missing.len());
    [&order[..kept], &missing].concat()
}

/// By definition: from the root every node is met, once; every place is one leaf's at most.
fn is_tree(nodes: &[BinaryNode], places: usize) -> bool {
    let (mut met, mut taken) = (vec![false; nodes.len()], vec![false; places]);
    let mut todo = Vec::from_iter((!nodes.is_empty()).then_some(0));
    while let Some(index) = todo.pop() {
        if index >= nodes.len() || core::mem::replace(&mut met[index], true) {
            return false;
        }
        let first = nodes[index].first as usize;
        if !nodes[index].is_leaf() {
            todo.extend([first, first + 1]);
            continue;
        }
        let Some(taken) = taken.get_mut(first..first + nodes[index].count as usize) else {
            return false;
        };
        if taken
            .iter_mut()
            .any(|taken| core::mem::replace(taken, true))
        {
            return false;
        }
    }
    met.iter().all(|&met| met)
}

/// Whether what an error says of the nodes is so.
fn is_true(error: TreeError, nodes: &[BinaryNode]) -> bool {
    let leads_to = |node: usize, child: usize| {
        let first = nodes[node].first as usize;
        !nodes[node].is_leaf() && (first..first + 2).contains(&child)
    };
    let has_place = |node: usize, place: usize| {
        let first = nodes[node].first as usize;
        nodes[node].is_leaf() && (first..first + nodes[node].count as usize).contains(&place)
    };
    match error {
        TreeError::ChildOutOfRange { node } => {
            !nodes[node].is_leaf() && nodes[node].first as usize + 2 > nodes.len()
        }
        TreeError::ChildShared { node, child } => {
            leads_to(node, child) && (child == 0 || (0..node).any(|other| leads_to(other, child)))
        }
        TreeError::OrderOutOfRange { node } => nodes[node].is_leaf(),
        TreeError::PlaceShared { node, place } => {
            has_place(node, place) && (0..node).any(|other| has_place(other, place))
        }
        TreeError::Unreached { node } => {
            let mut todo = vec![0];
            let mut met = vec![false; nodes.len()];
            while let Some(index) = todo.pop() {
                if !core::mem::replace(&mut met[index], true) && !nodes[index].is_leaf() {
                    let first = nodes[index].first as usize;
                    todo.extend([first, first + 1]);
                }
            }
            met.iter().position(|met| !met) == Some(node)
        }
        _ => false,
    }
}

/// What should be wrong with a tree over so many primitives, of which `can_be_hit` are.
fn tree_error(
    tree: &BinaryTree,
    primitives: usize,
    can_be_hit: impl Fn(usize) -> bool,
) -> Option<BuildError> {
    let mut listed = vec![false; primitives];
    let mut stray: Option<usize> = None;
    for leaf in tree.nodes().iter().filter(|node| node.is_leaf()) {
        for place in leaf.first as usize..(leaf.first + leaf.count) as usize {
            match listed.get_mut(tree.order()[place] as usize) {
                Some(listed) => *listed = true,
                None => stray = Some(stray.map_or(place, |stray| stray.min(place))),
            }
        }
    }
    if let Some(place) = stray {
        return Some(BuildError::PrimitiveOutOfRange {
            place,
            primitive: tree.order()[place],
            primitives,
        });
    }
    let missing = |&primitive: &usize| !listed[primitive] && can_be_hit(primitive);
    let primitive = (0..primitives).find(missing)?;
    Some(BuildError::PrimitiveMissing { primitive })
}

fn triangles<N: Width>(input: &Input, mesh: &Mesh, tree: &BinaryTree) {
    let settings = &input.settings;
    let corners = mesh.corners();
    let built = N::build_from_tree(&settings.builder(), &mesh.view(), tree);
    let not_finite = first_not_finite(&corners).filter(|_| !settings.drop_non_finite);
    if let Some((first, at)) = not_finite {
        let error = built.err();
        assert!(
            matches!(error, Some(BuildError::NonFinitePosition { triangle, corner, .. })
                if (triangle, corner) == (first, at)),
            "{error:?}"
        );
        return;
    }
    let bvh = match built {
        Ok(bvh) => bvh,
        Err(error) => {
            let alone = settings.builder().drop_non_finite(true);
            let alone = N::build(&alone, &mesh.view()).expect("a build");
            let can_be_hit = |triangle: usize| alone.primitives().contains(&(triangle as u32));
            assert_eq!(Some(error), tree_error(tree, corners.len(), can_be_hit));
            return;
        }
    };
    let most = if mesh.is_large() { 8 } else { 30 };
    let rays = rays(&input.rays, &corners, most);
    let truth = of_mesh(&mesh.view(), &rays);
    assert_all(&N::ask(bvh.as_borrowed(), &rays, u64::MAX), &rays, &truth);
}

fn primitives<N: Width>(input: &Input, boxes: &[Aabb], tree: &BinaryTree) {
    let builder = input.settings.builder();
    let can_be_hit = |primitive: usize| boxes[primitive].is_finite();
    match N::build_primitives_from_tree(&builder, boxes, tree) {
        Ok(bvh) => {
            assert_eq!(tree_error(tree, boxes.len(), can_be_hit), None);
            let rays = rays(&input.rays, &corners(boxes), 30);
            let truth = of_boxes(&Cuboids(boxes), boxes.len(), &rays);
            let answers = N::ask_primitives(bvh.as_borrowed(), &Cuboids(boxes), &rays);
            assert_all(&answers, &rays, &truth);
        }
        Err(BuildError::NonFiniteBox { primitive } | BuildError::InvalidBox { primitive }) => {
            let aabb = boxes[primitive];
            assert!(aabb != Aabb::EMPTY && (aabb.is_empty() || !aabb.is_finite()));
        }
        Err(error) => assert_eq!(Some(error), tree_error(tree, boxes.len(), can_be_hit)),
    }
}
