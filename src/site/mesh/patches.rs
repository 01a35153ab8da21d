use std::collections::HashMap;

use glam::DVec3;

/// Cosine of the largest angle between normals of one plane (0.1 degrees).
const SAME_NORMAL: f64 = 1.0 - 1.5e-6;
/// Largest distance of a corner from the plane of the first triangle, m.
const SAME_PLANE_M: f64 = 1e-3;
/// No neighbour.
const NONE: u32 = u32::MAX;

/// A triangle: indices into points, objects and materials.
#[derive(Clone, Copy, Debug)]
pub(in crate::site) struct MeshTriangle {
    pub corners: [u32; 3],
    pub object: u32,
    pub material: u32,
    /// Line in the file; 0 where lines mean nothing.
    pub line: u32,
}

/// Groups triangles that lie in one plane, hang together by edges and have one object and material.
/// Groups are in the order of their first triangle, and so are the triangles in each.
pub(super) fn patches(points: &[DVec3], triangles: &[MeshTriangle]) -> Vec<Vec<u32>> {
    let neighbours = neighbours(points, triangles);
    let normals: Vec<DVec3> = triangles
        .iter()
        .map(|f| {
            let [a, b, c] = f.corners.map(|i| points[i as usize]);
            (b - a).cross(c - a).normalize_or_zero()
        })
        .collect();
    let mut taken = vec![false; triangles.len()];
    let mut out = Vec::new();
    let mut open = Vec::new();
    for seed in 0..triangles.len() {
        if taken[seed] {
            continue;
        }
        taken[seed] = true;
        let (normal, first) = (normals[seed], &triangles[seed]);
        let base = points[first.corners[0] as usize];
        let mut patch = vec![seed as u32];
        open.push(seed);
        while let Some(i) = open.pop() {
            for &n in &neighbours[i] {
                let Some(triangle) = triangles.get(n as usize).filter(|_| !taken[n as usize])
                else {
                    continue;
                };
                let flat = || {
                    let near =
                        |&c: &u32| (points[c as usize] - base).dot(normal).abs() < SAME_PLANE_M;
                    normals[n as usize].dot(normal) > SAME_NORMAL
                        && triangle.corners.iter().all(near)
                };
                if (triangle.object, triangle.material) == (first.object, first.material) && flat()
                {
                    taken[n as usize] = true;
                    patch.push(n);
                    open.push(n as usize);
                }
            }
        }
        patch.sort_unstable();
        out.push(patch);
    }
    out
}

/// Which triangle lies across each edge; none where more than two share it.
fn neighbours(points: &[DVec3], triangles: &[MeshTriangle]) -> Vec<[u32; 3]> {
    // Exporters repeat a corner for each face's own normal.
    let mut known: HashMap<[u64; 3], u32> = HashMap::with_capacity(points.len());
    let welded: Vec<u32> = points
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let key = (*p + DVec3::ZERO).to_array().map(f64::to_bits);
            *known.entry(key).or_insert(i as u32)
        })
        .collect();
    drop(known);
    let mut edges: Vec<(u64, u32)> = Vec::with_capacity(3 * triangles.len());
    for (i, triangle) in triangles.iter().enumerate() {
        let corners = triangle.corners.map(|c| u64::from(welded[c as usize]));
        for side in 0..3 {
            let (a, b) = (corners[side], corners[(side + 1) % 3]);
            edges.push((a.min(b) << 32 | a.max(b), (3 * i + side) as u32));
        }
    }
    edges.sort_unstable();
    let mut out = vec![[NONE; 3]; triangles.len()];
    for shared in edges.chunk_by(|a, b| a.0 == b.0) {
        if let [(_, a), (_, b)] = *shared {
            out[a as usize / 3][a as usize % 3] = b / 3;
            out[b as usize / 3][b as usize % 3] = a / 3;
        }
    }
    out
}
