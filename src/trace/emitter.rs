use glam::{DVec3, Vec3};

use crate::base::{Frame, Stream};
use crate::site::Site;
use crate::site::bsdf::Bsdf;

/// One side of a PV surface, as photons start from it.
#[derive(Debug)]
pub(super) struct Emitter<'a> {
    /// The PV surface's number.
    pub surface: u16,
    /// Its frame; z is the normal of this side.
    pub frame: Frame,
    /// How it scatters.
    pub bsdf: &'a Bsdf,
    /// Area, m2.
    pub area_m2: f64,
    /// Height along the normal from which photons start. All of the surface lies below, however
    /// uneven its corners are, so that it never shades or hits itself.
    pub start_m: f64,
    /// Height along the normal below which nothing can be hit by what leaves this side.
    pub floor_m: f64,
    /// Corners of the triangles, metres.
    pub triangles: Vec<[DVec3; 3]>,
    /// Share of the area in the triangles up to and with this one.
    cumulative: Vec<f64>,
}

/// Farthest coordinate of the scene from the local origin, m: what f32 rounding scales with.
pub(super) fn reach_m(site: &Site) -> f64 {
    if site.bounds.is_empty() {
        return 0.0;
    }
    f64::from(site.bounds.min.abs().max(site.bounds.max.abs()).max_element())
}

/// How far above its surface a photon starts, m: above all rounding of f32 positions and
/// directions over the scene (one part in 16 million, some 30 times over), and a millimetre at least.
fn lift_m(site: &Site) -> f64 {
    (4e-6 * reach_m(site)).max(1e-3)
}

/// All sides that emit, by surface, front before back. Surfaces without area are left out.
pub(super) fn emitters<'a>(site: &Site, bsdfs: &[&'a Bsdf]) -> Vec<Emitter<'a>> {
    let lift = lift_m(site);
    let mut out = Vec::new();
    for (number, (pv, bsdf)) in site.pv.iter().zip(bsdfs).enumerate() {
        let triangles: Vec<_> = pv
            .triangles
            .iter()
            .map(|&t| site.triangles[t as usize].corners.map(Vec3::as_dvec3))
            .collect();
        let mut area_m2 = 0.0;
        let mut cumulative: Vec<f64> = triangles
            .iter()
            .map(|[a, b, c]| {
                area_m2 += 0.5 * (*b - *a).cross(*c - *a).length();
                area_m2
            })
            .collect();
        let usable = area_m2 > 0.0 && area_m2.is_finite() && pv.normal.length_squared() > 0.5;
        let Ok(surface) = u16::try_from(number) else { break };
        if !usable {
            continue;
        }
        for share in &mut cumulative {
            *share /= area_m2;
        }
        let sides = if pv.two_sided { 2 } else { 1 };
        for normal in [pv.normal, -pv.normal].into_iter().take(sides) {
            let normal = normal.normalize();
            let top = triangles
                .iter()
                .flatten()
                .fold(f64::NEG_INFINITY, |most, &corner| most.max(normal.dot(corner)));
            out.push(Emitter {
                surface,
                frame: Frame::around(normal),
                bsdf,
                area_m2,
                start_m: top + lift,
                floor_m: top + 0.5 * lift,
                triangles: triangles.clone(),
                cumulative: cumulative.clone(),
            });
        }
    }
    out
}

impl Emitter<'_> {
    /// A point uniform on the surface, moved to where photons start, m.
    #[inline]
    pub(super) fn point(&self, random: &mut Stream) -> DVec3 {
        let pick = random.uniform();
        let (u, v) = (random.uniform(), random.uniform());
        let i = self.cumulative.partition_point(|&share| share <= pick);
        let [a, b, c] = self.triangles[i.min(self.triangles.len() - 1)];
        // The unit square folded onto the triangle keeps it uniform.
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        self.lifted(a + (b - a) * u + (c - a) * v)
    }

    /// `point` moved along the normal to where photons start.
    #[inline]
    pub(super) fn lifted(&self, point: DVec3) -> DVec3 {
        point + self.frame.z * (self.start_m - self.frame.z.dot(point))
    }
}
