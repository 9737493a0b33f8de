//! Files good and bad, as a user has them: what loads is right, what does not says why on one line.

use std::{fs, path::PathBuf};
use tempfile::TempDir;
use wide_bvh_scenes::{LoadError, Mesh, Reason, load};

/// A folder for one test's files.
struct Files(TempDir);

impl Files {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn load(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<Mesh, LoadError> {
        let path = self.path(name);
        fs::write(&path, bytes).unwrap();
        load(&path)
    }

    fn reason(&self, name: &str, bytes: impl AsRef<[u8]>) -> Reason {
        let error = self.load(name, bytes).unwrap_err();
        let line = error.to_string();
        assert!(line.contains(name), "{line}");
        assert!(!line.contains(['\n', '\r']), "{line}");
        error.reason
    }
}

const SQUARE: [[f32; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [1.0, 1.0, 0.5],
    [0.0, 1.0, 0.5],
];
const HALVES: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

const ASCII_PLY: &str = "ply\nformat ascii 1.0\ncomment a square\nelement vertex 4\nproperty float x\n\
    property float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0\n1 0 0\n1 1 0.5\n0 1 0.5\n4 0 1 2 3\n";

/// The square as a polygon of four, with properties before and after those that count.
fn binary_ply(big_endian: bool) -> Vec<u8> {
    let order = if big_endian { "big" } else { "little" };
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement vertex 4\nproperty uchar red\nproperty double x\n\
         property float y\nproperty float z\nelement edge 1\nproperty int vertex1\nelement face 1\n\
         property list uchar uint vertex_index\nproperty float quality\nend_header\n"
    )
    .into_bytes();
    let ordered = |mut number: Vec<u8>| {
        if !big_endian {
            number.reverse();
        }
        number
    };
    for [x, y, z] in SQUARE {
        bytes.push(200);
        bytes.extend(ordered(f64::from(x).to_be_bytes().to_vec()));
        bytes.extend(ordered(y.to_be_bytes().to_vec()));
        bytes.extend(ordered(z.to_be_bytes().to_vec()));
    }
    bytes.extend([0; 4]);
    bytes.push(4);
    for index in 0..4_u32 {
        bytes.extend(ordered(index.to_be_bytes().to_vec()));
    }
    bytes.extend([0; 4]);
    bytes
}

const OBJ: &str = "# a square\no square\nv 0 0 0\nv 1 0 0\nv 1 1 0.5\nv 0 1 0.5\nvn 0 0 1\n\
    usemtl none\nf 1//1 2//1 3//1 4//1\n";

/// Positions, then 16-bit indices.
fn gltf_buffer() -> Vec<u8> {
    let mut buffer: Vec<u8> = SQUARE
        .iter()
        .flatten()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    buffer.extend(
        HALVES
            .iter()
            .flatten()
            .flat_map(|&i| (i as u16).to_le_bytes()),
    );
    buffer
}

/// The square below a node that doubles it, below one that lifts it.
fn gltf_json(uri: &str) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[1]}}],
        "nodes":[{{"mesh":0,"scale":[2,2,2]}},{{"children":[0],"translation":[0,10,0]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "accessors":[
          {{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,0.5]}},
          {{"bufferView":1,"componentType":5123,"count":6,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":12}}],
        "buffers":[{{{uri}"byteLength":60}}]}}"#
    )
}

fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + json.len() + 8 + binary.len();
    let mut bytes = b"glTF".to_vec();
    bytes.extend(2_u32.to_le_bytes());
    bytes.extend((length as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json.as_slice()), (b"BIN\0", binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

fn square_glb() -> Vec<u8> {
    glb(&gltf_json(""), &gltf_buffer())
}

#[test]
fn every_kind_of_ply() {
    let files = Files::new();
    let crlf = ASCII_PLY.replace('\n', "\r\n").into_bytes();
    let kinds = [
        ("ascii.ply", ASCII_PLY.into()),
        ("little.ply", binary_ply(false)),
        ("big.ply", binary_ply(true)),
        ("crlf.ply", crlf),
    ];
    for (name, bytes) in kinds {
        let mesh = files.load(name, bytes).unwrap();
        assert_eq!(mesh.positions, SQUARE, "{name}");
        assert_eq!(mesh.indices, HALVES, "{name}");
        assert_eq!(name.strip_suffix(".ply"), Some(mesh.name.as_str()));
    }
}

#[test]
fn obj_with_a_polygon() {
    let files = Files::new();
    for name in ["square.obj", "square.txt", "square.OBJ"] {
        let mesh = files.load(name, OBJ).unwrap();
        assert_eq!(mesh.positions, SQUARE);
        assert_eq!(mesh.indices, HALVES);
    }
    let latin = [b"# caf\xe9\n", OBJ.as_bytes()].concat();
    assert_eq!(files.load("latin.obj", latin).unwrap().indices, HALVES);
}

#[test]
fn gltf_with_its_nodes_applied() {
    let files = Files::new();
    let base64 = base64::Engine::encode(&base64::prelude::BASE64_STANDARD, gltf_buffer());
    let embedded = format!(r#""uri":"data:application/octet-stream;base64,{base64}","#);
    fs::write(files.path("side buffer.bin"), gltf_buffer()).unwrap();
    let kinds = [
        ("square.glb", square_glb()),
        ("embedded.gltf", gltf_json(&embedded).into()),
        (
            "beside.gltf",
            gltf_json(r#""uri":"side%20buffer.bin","#).into(),
        ),
    ];
    let want = SQUARE.map(|[x, y, z]| [2.0 * x, 2.0 * y + 10.0, 2.0 * z]);
    for (name, bytes) in kinds {
        let mesh = files.load(name, bytes).unwrap();
        assert_eq!(mesh.positions, want, "{name}");
        assert_eq!(mesh.indices, HALVES, "{name}");
    }
}

#[test]
fn gltf_strips_keep_their_winding_and_fans_their_hub() {
    let files = Files::new();
    // The indices are 0 1 2 0 2 3.
    let kinds = [
        ("\"mode\":5", [[0, 1, 2], [1, 0, 2], [2, 0, 2], [0, 3, 2]]),
        ("\"mode\":6", [[0, 1, 2], [0, 2, 0], [0, 0, 2], [0, 2, 3]]),
    ];
    for (mode, want) in kinds {
        let json = gltf_json("").replace("\"indices\":1", &format!("\"indices\":1,{mode}"));
        let mesh = files.load("strip.glb", glb(&json, &gltf_buffer())).unwrap();
        assert_eq!(mesh.indices, want);
    }
}

#[test]
fn content_counts_more_than_the_extension() {
    let files = Files::new();
    assert_eq!(files.load("ply.obj", ASCII_PLY).unwrap().indices, HALVES);
    assert_eq!(files.load("glb.ply", square_glb()).unwrap().indices, HALVES);
    assert_eq!(files.load("obj.ply", OBJ).unwrap().indices, HALVES);
}

#[test]
fn missing_empty_folder_and_foreign() {
    let files = Files::new();
    let missing = load(&files.path("missing.ply")).unwrap_err();
    assert!(missing.to_string().ends_with("missing.ply: no such file"));
    let folder = load(files.0.path()).unwrap_err();
    assert!(matches!(folder.reason, Reason::Unreadable(_)));
    assert_eq!(files.reason("empty.ply", ""), Reason::Empty);
    let png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR";
    for name in ["picture.ply", "picture.png", "picture.obj", "picture.glb"] {
        assert_eq!(files.reason(name, png), Reason::AnotherKind);
    }
    assert_eq!(
        files.reason("prose.txt", "Once upon a time\n"),
        Reason::AnotherKind
    );
    assert!(matches!(
        files.reason("list.json", "{\"a\":1}"),
        Reason::Malformed { .. }
    ));
}

#[test]
fn truncated_anywhere() {
    let files = Files::new();
    for (name, whole) in [
        ("cut.ply", binary_ply(false)),
        ("cut.ply", binary_ply(true)),
        ("cut.glb", square_glb()),
    ] {
        for length in 1..whole.len() {
            files.reason(name, &whole[..length]);
        }
        assert_eq!(
            files.reason(name, &whole[..whole.len() - 1]),
            Reason::Truncated
        );
    }
    // What is left of a text may be a smaller mesh; it never is a larger one, nor a panic.
    for (name, whole) in [("cut.ply", ASCII_PLY), ("cut.obj", OBJ)] {
        for length in 0..whole.len() {
            if let Ok(mesh) = files.load(name, &whole[..length]) {
                assert!(mesh.indices.len() <= HALVES.len());
            }
        }
    }
}

#[test]
fn indices_out_of_range() {
    let files = Files::new();
    let range = |index| Reason::IndexOutOfRange { index, vertices: 4 };
    let face = |face: &str| ASCII_PLY.replace("4 0 1 2 3", face);
    assert_eq!(files.reason("high.ply", face("3 0 1 4")), range(4));
    assert_eq!(files.reason("low.ply", face("3 0 -1 2")), range(-1));
    let mut binary = gltf_buffer();
    binary[48] = 7;
    assert_eq!(
        files.reason("high.glb", glb(&gltf_json(""), &binary)),
        range(7)
    );
    assert!(matches!(
        files.reason("high.obj", OBJ.replace("3//1 4//1", "9//1 4//1")),
        Reason::Malformed { format: "OBJ", .. }
    ));
}

#[test]
fn no_triangles() {
    let files = Files::new();
    let line = ASCII_PLY.replace("4 0 1 2 3", "2 0 1");
    assert_eq!(files.reason("line.ply", line), Reason::NoTriangles);
    assert_eq!(
        files.reason("points.obj", "v 0 0 0\nv 1 1 1\n"),
        Reason::NoTriangles
    );
    let points = gltf_json("").replace("\"indices\":1", "\"indices\":1,\"mode\":0");
    assert_eq!(
        files.reason("points.glb", glb(&points, &gltf_buffer())),
        Reason::NoTriangles
    );
}

#[test]
fn headers_that_promise_too_much() {
    let files = Files::new();
    let vertices = ASCII_PLY.replace("vertex 4", "vertex 99999999999999");
    assert_eq!(files.reason("many.ply", vertices), Reason::Truncated);
    let nothings = ASCII_PLY
        .replace(
            "element face",
            "element nothing 18446744073709551615\nelement face",
        )
        .replace("ascii", "binary_little_endian");
    assert_eq!(files.reason("nothings.ply", nothings), Reason::Truncated);
    let flat = ASCII_PLY.replace("property float z\n", "");
    assert!(matches!(
        files.reason("flat.ply", flat),
        Reason::Malformed { .. }
    ));
    let floats = ASCII_PLY.replace("uchar int", "uchar float");
    assert!(matches!(
        files.reason("floats.ply", floats),
        Reason::Malformed { .. }
    ));

    for (from, to) in [
        ("\"count\":4", "\"count\":5"),
        ("\"count\":4", "\"count\":18446744073709551615"),
        ("\"count\":6", "\"count\":4000000000"),
        ("\"byteLength\":48}", "\"byteLength\":18446744073709551615}"),
        ("\"byteOffset\":48", "\"byteOffset\":18446744073709551615"),
        ("\"byteLength\":48}", "\"byteLength\":48,\"byteStride\":4}"),
        ("\"byteLength\":60", "\"byteLength\":61000"),
        ("5126", "5125"),
        ("5123", "5126"),
        ("\"buffer\":0", "\"buffer\":9"),
        ("\"mesh\":0", "\"mesh\":9"),
    ] {
        let json = gltf_json("");
        assert!(json.contains(from));
        files.reason("lying.glb", glb(&json.replace(from, to), &gltf_buffer()));
    }
}

#[test]
fn gltf_nodes_in_a_circle_end() {
    let files = Files::new();
    let circle = gltf_json("").replace("\"mesh\":0,", "\"mesh\":0,\"children\":[1],");
    let mesh = files
        .load("circle.glb", glb(&circle, &gltf_buffer()))
        .unwrap();
    assert_eq!(mesh.indices, HALVES);
}

/// Bytes changed at random, many times over: any answer will do but a panic or an index out of range.
#[test]
fn damaged_files() {
    let files = Files::new();
    let mut rng = fastrand::Rng::with_seed(1);
    for (name, whole) in [
        ("damaged.ply", ASCII_PLY.into()),
        ("damaged.ply", binary_ply(false)),
        ("damaged.obj", OBJ.into()),
        ("damaged.glb", square_glb()),
    ] {
        for _ in 0..500 {
            let mut bytes: Vec<u8> = whole.clone();
            for _ in 0..rng.usize(1..4) {
                let at = rng.usize(..bytes.len());
                // A digit keeps the text well-formed more often than any byte would.
                bytes[at] = if rng.bool() {
                    rng.u8(b'-'..=b'9')
                } else {
                    rng.u8(..)
                };
            }
            if let Ok(mesh) = files.load(name, &bytes) {
                let vertices = mesh.positions.len() as u32;
                assert!(mesh.indices.iter().flatten().all(|&i| i < vertices));
            }
        }
    }
}
