//! Embree, opened when running: its trees, and the calls that trace them.
//!
//! Rays are in Embree's own format beforehand; copying what a call overwrites is timed. Making a device is not:
//! that readies the library. Bytes are what its memory monitor counts. The vertex and index buffers are
//! shared, so they are not in it.

mod device;
mod ffi;
mod packet;
mod scene;
mod single;
mod stream;

use super::{Batch, Builder, Built, Chosen, Engine, Takes};
use device::Device;
use ffi::{Api, StreamCalls};
use libloading::Library;
use packet::Packets;
use scene::{Buffers, Recipe, Scene};
use std::{error::Error, ffi::c_int, fmt, rc::Rc, sync::LazyLock};
use stream::Stream;
use wide_bvh::geometry::{Ray, TriangleMesh};

/// The newest Embree of version 4 or 3 where the system looks for libraries. It is never closed: the
/// threads that its scheduler keeps would lose their code.
static API: LazyLock<Option<Api>> = LazyLock::new(|| {
    [4, 3].into_iter().find_map(|major| {
        let name = format!("embree{major}");
        let plain = libloading::library_filename(&name);
        // What a system without the development package has.
        let versioned = format!("lib{name}.so.{major}").into();
        [plain, versioned].into_iter().find_map(|file| {
            // SAFETY: a library of this name is Embree, whose initialisation asks nothing of the
            // program that loads it.
            let library = unsafe { Library::new(&file) }.ok()?;
            // SAFETY: the name tells the version.
            unsafe { Api::new(library, major) }.ok()
        })
    })
});

/// Which Embree races, or how to install one.
///
/// # Errors
/// Embree cannot make a device.
pub fn about() -> Result<String, EmbreeError> {
    match &*API {
        Some(api) => Ok(Recipe::HIGH.device(api)?.describe()),
        None => Ok(HOW_TO_INSTALL.to_owned()),
    }
}

const HOW_TO_INSTALL: &str = "Embree is not installed, so the race goes on without it: it takes \
    libembree4 or libembree3 (Debian and Ubuntu: apt-get install libembree-dev)";

/// Trees of one thread. HIGH has all calls, the others single rays alone: in the robust mode and the compact one, on AVX2 where
/// the ordinary one would use AVX-512, and of MEDIUM quality. None without Embree.
///
/// # Errors
/// Embree cannot make a device or a scene.
pub fn engines(
    mesh: &TriangleMesh<'_>,
    chosen: Chosen<'_>,
) -> Result<Vec<Box<dyn Engine>>, EmbreeError> {
    let Some(api) = &*API else {
        return Ok(Vec::new());
    };
    let high = Recipe::HIGH;
    let robust = Recipe {
        flags: ffi::SCENE_FLAG_ROBUST,
        ..high
    };
    let medium = Recipe {
        quality: ffi::BUILD_QUALITY_MEDIUM,
        ..high
    };
    let compact = Recipe {
        flags: ffi::SCENE_FLAG_COMPACT,
        ..high
    };
    let avx2 = Recipe { avx2: true, ..high };
    let device = high.device(api)?;
    let single = vec![Call::Single];
    let mut trees = vec![
        ("embree HIGH", high, Call::all(&device)),
        ("embree HIGH robust", robust, single.clone()),
        ("embree HIGH compact", compact, single.clone()),
        ("embree MEDIUM", medium, single.clone()),
    ];
    if device.has_avx512() {
        trees.push(("embree HIGH avx2", avx2, single));
    }
    let buffers = Buffers::new(mesh);
    let mut engines = Vec::new();
    for (tree, recipe, calls) in trees {
        let named = |call: Call| (format!("{tree}{}", call.suffix()), call);
        let mut calls: Vec<_> = calls.into_iter().map(named).collect();
        calls.retain(|(name, _)| chosen(name));
        if calls.is_empty() {
            continue;
        }
        let (scene, built) = Scene::build(api, &buffers, recipe)?;
        let scene = Rc::new(scene);
        engines.extend(calls.into_iter().map(|(name, call)| {
            Box::new(Embree {
                name,
                built,
                scene: Rc::clone(&scene),
                call,
            }) as Box<dyn Engine>
        }));
    }
    Ok(engines)
}

/// Its builders. None without Embree.
pub fn builders<'a>(mesh: &TriangleMesh<'_>) -> Vec<Builder<'a>> {
    let Some(api) = &*API else {
        return Vec::new();
    };
    let buffers = Buffers::new(mesh);
    [
        ("embree LOW", ffi::BUILD_QUALITY_LOW),
        ("embree MEDIUM", ffi::BUILD_QUALITY_MEDIUM),
        ("embree HIGH", ffi::BUILD_QUALITY_HIGH),
    ]
    .map(|(name, quality)| {
        let buffers = Rc::clone(&buffers);
        let build = move |threads| {
            let recipe = Recipe {
                threads,
                quality,
                ..Recipe::HIGH
            };
            let (scene, built) = Scene::build(api, &buffers, recipe)?;
            Ok(Box::new(Embree {
                name: name.to_owned(),
                built,
                scene: Rc::new(scene),
                call: Call::Single,
            }) as Box<dyn Engine>)
        };
        Builder {
            name,
            build: Box::new(build),
        }
    })
    .into()
}

/// What Embree said went wrong: an `RTCError`.
#[derive(Debug)]
pub struct EmbreeError(c_int);

impl fmt::Display for EmbreeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Embree failed with RTCError {}", self.0)
    }
}

impl Error for EmbreeError {}

/// How rays are handed over.
#[derive(Clone, Copy)]
enum Call {
    /// `rtcIntersect1`, `rtcOccluded1`.
    Single,
    /// `rtcIntersect8`, `rtcOccluded8`.
    Packet8 { coherent: bool },
    /// `rtcIntersect16`, `rtcOccluded16`.
    Packet16 { coherent: bool },
    /// `rtcIntersect1M`, `rtcOccluded1M`.
    Stream { calls: StreamCalls, coherent: bool },
}

impl Call {
    /// What the device has; packets of 16 only where vectors are as wide.
    fn all(device: &Device) -> Vec<Self> {
        let mut calls = vec![Self::Single];
        for coherent in [true, false] {
            calls.push(Self::Packet8 { coherent });
            if device.has_avx512() {
                calls.push(Self::Packet16 { coherent });
            }
            let stream = device
                .stream()
                .map(|calls| Self::Stream { calls, coherent });
            calls.extend(stream);
        }
        calls
    }

    /// What it adds to the tree's name.
    fn suffix(self) -> &'static str {
        match self {
            Self::Single => "",
            Self::Packet8 { coherent: true } => " 8 coherent",
            Self::Packet8 { coherent: false } => " 8",
            Self::Packet16 { coherent: true } => " 16 coherent",
            Self::Packet16 { coherent: false } => " 16",
            Self::Stream { coherent: true, .. } => " 1M coherent",
            Self::Stream {
                coherent: false, ..
            } => " 1M",
        }
    }
}

/// A tree and a call.
struct Embree {
    name: String,
    built: Built,
    scene: Rc<Scene>,
    call: Call,
}

impl Engine for Embree {
    fn name(&self) -> &str {
        &self.name
    }

    fn built(&self) -> Built {
        self.built
    }

    fn takes(&self) -> Takes {
        match self.call {
            Call::Single => Takes::OneRay,
            _ => Takes::Batches,
        }
    }

    fn prepare<'a>(&'a self, rays: &'a [Ray]) -> Box<dyn Batch + 'a> {
        let (scene, api) = (&*self.scene, self.scene.api());
        match self.call {
            Call::Single => Box::new(single::Rays::new(scene, rays)),
            Call::Packet8 { coherent } => {
                Box::new(Packets::new(scene, api.packet8, coherent, rays))
            }
            Call::Packet16 { coherent } => {
                Box::new(Packets::new(scene, api.packet16, coherent, rays))
            }
            Call::Stream { calls, coherent } => Box::new(Stream::new(scene, calls, coherent, rays)),
        }
    }
}
