//! Bytes opened as every kind of hierarchy, and what opens asked in every way.

use crate::{
    Answers, Liar,
    ask::{ask, ask_mesh, ask_primitives},
};
use wide_bvh::{
    geometry::{Aabb, Ray, TriangleMesh},
    layout::{
        Borrowed, Bvh, ByList, BytesError, CompactNode4, CompactNode8, InOrder, Node4, Node8, Open,
        Order, PrimitiveLeaf, Runs, TriangleLeaf, WideNode,
    },
};

/// What bytes opened as.
#[derive(Debug)]
pub struct Opened {
    /// Of each ray, in every way.
    pub answers: Vec<Answers>,
    /// Written again.
    pub bytes: Vec<u8>,
    /// The number of each primitive in the leaves; none if there is no list.
    pub primitives: Vec<u32>,
    /// How many there are.
    pub count: usize,
}

/// Opens bytes as every kind of nodes with every kind of leaves that go with them, and asks what opens. `mesh` is what leaves
/// are put over that have none of their own; `boxes` are a caller's primitives.
///
/// One outcome for each kind, always in the same order.
pub fn open(
    bytes: &[u8],
    rays: &[Ray],
    mesh: &TriangleMesh,
    boxes: &[Aabb],
) -> Vec<Result<Opened, BytesError>> {
    let given = Given { rays, mesh, boxes };
    let mut outcomes = Vec::new();
    outcomes.extend(of_nodes::<Node4>(bytes, &given));
    outcomes.extend(of_nodes::<Node8>(bytes, &given));
    outcomes.extend(of_nodes::<CompactNode4>(bytes, &given));
    outcomes.extend(of_nodes::<CompactNode8>(bytes, &given));
    // Of other nodes nobody writes any: they would take as long again to compile.
    outcomes.extend(of_runs::<CompactNode4, InOrder>(bytes, &given));
    outcomes.extend(of_runs::<CompactNode8, InOrder>(bytes, &given));
    outcomes
}

struct Given<'a> {
    rays: &'a [Ray],
    mesh: &'a TriangleMesh<'a>,
    boxes: &'a [Aabb],
}

#[inline(never)]
fn of_nodes<N: WideNode>(bytes: &[u8], given: &Given) -> Vec<Result<Opened, BytesError>> {
    let Given { rays, boxes, .. } = *given;
    let mut outcomes = vec![
        opened::<N, TriangleLeaf>(bytes, |bvh| ask(bvh, rays, u64::MAX)),
        opened::<N, PrimitiveLeaf>(bytes, |bvh| ask_primitives(bvh, &Liar(boxes), rays)),
    ];
    outcomes.extend(of_runs::<N, ByList>(bytes, given));
    outcomes
}

fn of_runs<N: WideNode, O: Order>(bytes: &[u8], given: &Given) -> [Result<Opened, BytesError>; 2] {
    let Given { rays, mesh, .. } = *given;
    [
        opened::<N, Runs<(), O>>(bytes, |bvh| match bvh.over(mesh) {
            Ok(bvh) => ask_mesh(bvh, rays),
            Err(error) => {
                assert!(error.needed > mesh.len() as u64);
                Vec::new()
            }
        }),
        opened::<N, Runs<TriangleMesh, O>>(bytes, |bvh| ask_mesh(bvh, rays)),
    ]
}

fn opened<'a, N: WideNode, L: Open<'a> + 'a>(
    bytes: &'a [u8],
    ask: impl FnOnce(Bvh<N, L, Borrowed<'a>>) -> Vec<Answers>,
) -> Result<Opened, BytesError> {
    let bvh = Bvh::<N, L, Borrowed>::from_bytes(bytes).inspect_err(|error| {
        assert!(!error.to_string().is_empty());
    })?;
    assert!(!format!("{bvh:?}").is_empty());
    Ok(Opened {
        bytes: bvh.to_bytes().expect("as many as there were"),
        primitives: bvh.primitives().to_vec(),
        count: bvh.primitive_count(),
        answers: ask(bvh),
    })
}
