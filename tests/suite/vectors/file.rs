//! The files: a mesh, rays and the bits of their hits, as little-endian words of 32 bits.
//!
//! Three counts, of vertices, triangles and rays; then 3 words a vertex, 3 a triangle, 8 a ray (origin, direction,
//! least and greatest `t`), and 4 a ray for its hit: `t`, `u`, `v` and the triangle's number, all [`MISS`] for none.

use wide_bvh::geometry::{Hit, Ray};

/// A word of a ray that hits nothing: no triangle's number, and the bits of a NaN.
const MISS: u32 = u32::MAX;

/// What a file says.
pub struct Vectors {
    pub positions: Vec<[f32; 3]>,
    pub indices: Vec<[u32; 3]>,
    pub rays: Vec<Ray>,
    pub hits: Vec<Option<Hit>>,
}

impl Vectors {
    /// # Panics
    /// If it is not such a file.
    pub fn parse(bytes: &[u8]) -> Self {
        let (words, rest) = bytes.as_chunks();
        assert!(rest.is_empty());
        let mut words = words.iter().map(|&word| u32::from_le_bytes(word));
        let mut word = || words.next().expect("a file that is whole");
        let [vertices, triangles, rays] = [word(), word(), word()];
        let mut float = || f32::from_bits(word());
        let positions = (0..vertices).map(|_| [float(), float(), float()]).collect();
        let indices = (0..triangles).map(|_| [word(), word(), word()]).collect();
        let mut float = || f32::from_bits(word());
        let rays: Vec<_> = (0..rays)
            .map(|_| {
                let [origin, direction] = [(); 2].map(|()| [float(), float(), float()]);
                Ray::new(origin, direction).with_range(float(), float())
            })
            .collect();
        let hits = rays
            .iter()
            .map(|_| {
                let [t, u, v, primitive] = [word(), word(), word(), word()];
                let [t, u, v] = [t, u, v].map(f32::from_bits);
                (primitive != MISS).then_some(Hit { t, u, v, primitive })
            })
            .collect();
        assert!(words.next().is_none());
        Self {
            positions,
            indices,
            rays,
            hits,
        }
    }

    #[allow(dead_code, reason = "not all who read write")]
    pub fn to_bytes(&self) -> Vec<u8> {
        let counts = [self.positions.len(), self.indices.len(), self.rays.len()];
        let mut words: Vec<u32> = counts.map(|count| count as u32).to_vec();
        words.extend(self.positions.iter().flatten().map(|x| x.to_bits()));
        words.extend(self.indices.iter().flatten());
        for ray in &self.rays {
            let ends = [ray.origin.to_array(), ray.direction.to_array()];
            words.extend(ends.iter().flatten().map(|x| x.to_bits()));
            words.extend([ray.t_min.to_bits(), ray.t_max.to_bits()]);
        }
        for &hit in &self.hits {
            words.extend(bits(hit).unwrap_or([MISS; 4]));
        }
        words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }
}

/// A hit as bits, for -0 to differ from 0.
pub fn bits(hit: Option<Hit>) -> Option<[u32; 4]> {
    hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.primitive])
}
