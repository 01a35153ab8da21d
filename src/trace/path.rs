use std::ops::Range;

use glam::DVec3;

use super::Error;
use super::disc::Disc;
use super::emission::{Emission, Receivers};
use super::emitter::{Emitter, emitters};
use super::horizon::{Horizon, horizons};
use super::power::{Power, Shares};
use crate::base::{Fate, Photon, Purpose, Stream, Tally};

/// Everything that photons need, worked out once.
pub(super) struct Tracer<'a> {
    emission: &'a Emission<'a>,
    emitters: Vec<Emitter<'a>>,
    horizons: Vec<Option<Horizon>>,
    disc: Disc,
    power: Power,
    max_path_m: f32,
}

/// What a range of photons came to.
#[derive(Debug, Default)]
pub(super) struct Batch {
    pub tally: Tally,
    pub photons: Vec<Photon>,
}

/// Which photons: of how many, and drawn for what.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draw {
    pub purpose: Purpose,
    pub seed: u64,
    pub emitted: u64,
}

impl<'a> Tracer<'a> {
    pub(super) fn new(emission: &'a Emission<'a>) -> Result<Self, Error> {
        emission.check()?;
        let disc = Disc::new(emission.timeline.sun_diameter_deg);
        let emitters = emitters(emission.site, &emission.bsdfs);
        let power = Power::of(&emitters, &disc, emission.timeline);
        if power.total_w().partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
            return Err(Error::NoFlux { timesteps: emission.timeline.steps.len() });
        }
        let horizons = horizons(emission.site, &emitters, emission.settings.max_path_m);
        let max_path_m = emission.settings.max_path_m as f32;
        Ok(Self { emission, emitters, horizons, disc, power, max_path_m })
    }

    /// Watts that all photons carry together.
    pub(super) fn total_w(&self) -> f64 {
        self.power.total_w()
    }

    /// Sends photons `numbers` of `draw.emitted`.
    pub(super) fn send(&self, draw: Draw, numbers: Range<u64>, keep: bool) -> Batch {
        let mut out = Batch::default();
        let each_w = self.power.total_w() / draw.emitted as f64;
        let shares = |step| Shares::of(&self.emitters, &self.disc, self.emission.timeline, step);
        let mut current = shares(self.power.find(numbers.start as f64 * each_w));
        for number in numbers {
            let mut random = Stream::new(draw.seed, draw.purpose, number);
            let at_w = (number as f64 + random.uniform()) * each_w;
            let step = self.power.step_at(at_w, current.step);
            if step != current.step {
                current = shares(step);
            }
            self.one(&current, at_w, each_w, &mut random, keep, &mut out);
        }
        out
    }

    /// Sends one photon and books it.
    #[inline]
    fn one(
        &self,
        shares: &Shares,
        at_w: f64,
        each_w: f64,
        random: &mut Stream,
        keep: bool,
        out: &mut Batch,
    ) {
        let Some((index, peak)) = shares.at(at_w - self.power.before_w(shares.step)) else {
            return out.tally.book(Fate::Blocked, 0.0, 0.0);
        };
        let emitter = &self.emitters[index];
        let to_sun = self.disc.direction(&shares.sun, random.uniform(), random.uniform());
        let incident = emitter.frame.local_from_world(to_sun);
        if incident.z <= 0.0 || to_sun.z <= 0.0 {
            return out.tally.book(Fate::Blocked, 0.0, 0.0);
        }
        // The photon stands for each_w / peak of what falls onto the PV per unit of cosine.
        let sent_w = each_w * incident.z / peak;
        let scattered = emitter.bsdf.sample_within(incident, peak / incident.z, random);
        let Some(scattered) = scattered else {
            return out.tally.book(Fate::Absorbed, sent_w, 0.0);
        };
        let left_w = each_w * scattered.weight;
        out.tally.over_bound += u64::from(scattered.weight > 1.0);
        let direction = emitter.frame.world_from_local(scattered.direction);
        let horizon = self.horizons[index].as_ref();
        if horizon.is_some_and(|h| h.clears_all(direction)) {
            return out.tally.book(Fate::NotSampled, sent_w, left_w);
        }
        let point = emitter.point(random);
        if horizon.is_some_and(|h| h.clears(point, direction)) {
            return out.tally.book(Fate::NotSampled, sent_w, left_w);
        }
        let (fate, hit) = self.fly(point, to_sun, direction);
        out.tally.book(fate, sent_w, left_w);
        if let Some((distance_m, triangle)) = hit.filter(|_| keep) {
            let towards = direction.as_vec3();
            let normal = self.emission.site.triangles[triangle as usize].normal();
            out.photons.push(Photon {
                position: (point + direction * f64::from(distance_m)).as_vec3(),
                normal: if normal.dot(towards) > 0.0 { -normal } else { normal },
                direction: -towards,
                flux_w: left_w as f32,
                timestep: shares.step as u32,
                surface: emitter.surface,
            });
        }
    }

    /// The way to the sun, and the flight: what becomes of the photon, and if it is kept, how far
    /// it flew and the triangle where it landed.
    fn fly(&self, point: DVec3, to_sun: DVec3, direction: DVec3) -> (Fate, Option<(f32, u32)>) {
        let site = self.emission.site;
        let (start, towards) = (point.as_vec3(), direction.as_vec3());
        let settings = &self.emission.settings;
        if settings.sun_visibility && site.bvh.occluded(start, to_sun.as_vec3(), 0.0, f32::INFINITY)
        {
            return (Fate::Blocked, None);
        }
        let Some(hit) = site.bvh.closest(start, towards, 0.0, self.max_path_m) else {
            let beyond = site.bvh.occluded(start, towards, self.max_path_m, f32::INFINITY);
            return (if beyond { Fate::TooFar } else { Fate::Escaped }, None);
        };
        let face = site.face_of(hit.triangle);
        if face.pv.is_some() {
            return (Fate::OnPv, None);
        }
        let kept = match settings.receivers {
            Receivers::All => true,
            Receivers::Diffuse => site.materials[face.material as usize].diffuse,
        };
        if kept {
            (Fate::Stored, Some((hit.distance_m, hit.triangle)))
        } else {
            (Fate::Escaped, None)
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::base::{Aabb, SpectralBasis, Timeline, Timestep};
    use crate::site::bsdf::{Bsdf, Model, on_circle};
    use crate::site::{Bvh, Face, Material, Object, PvSurface, Site, Triangle};
    use crate::trace::Settings;

    /// Terrain of large and small triangles, boxes here and there (some float), and PV.
    fn scene(seed: u64, pv: &[([Vec3; 4], bool)]) -> Site {
        let mut triangles = Vec::new();
        let mut faces = Vec::new();
        let mut quad = |corners: [Vec3; 4], pv: Option<u16>| {
            let first = triangles.len() as u32;
            for [i, j, k] in [[0, 1, 2], [0, 2, 3]] {
                let corners = [corners[i], corners[j], corners[k]];
                triangles.push(Triangle { corners, face: faces.len() as u32 });
            }
            faces.push(Face { object: 0, material: 0, pv });
            first
        };
        let mut random = Stream::new(seed, Purpose::Survey, 0);
        let mut one = |low: f32, high: f32| low + (high - low) * random.uniform() as f32;
        for i in 0..6 {
            for j in 0..6 {
                let at = |i: i32, j: i32| {
                    let (x, y) = (40.0 * i as f32 - 120.0, 40.0 * j as f32 - 120.0);
                    Vec3::new(x, y, -10.0 + 0.03 * x + 3.0 * ((i * 5 + j * 3) % 4) as f32)
                };
                quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], None);
            }
        }
        for _ in 0..40 {
            let base = Vec3::new(one(-90.0, 90.0), one(-90.0, 90.0), one(-12.0, 12.0));
            let size = Vec3::new(one(0.2, 12.0), one(0.2, 12.0), one(0.2, 9.0));
            let at = |x: u8, y: u8, z: u8| base + size * Vec3::new(x.into(), y.into(), z.into());
            quad([at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1)], None);
            quad([at(0, 1, 0), at(1, 1, 0), at(1, 1, 1), at(0, 1, 1)], None);
            quad([at(0, 0, 0), at(0, 1, 0), at(0, 1, 1), at(0, 0, 1)], None);
            // A slanted lid.
            quad([at(0, 0, 1), at(1, 0, 1), at(1, 1, 0), at(0, 1, 0)], None);
        }
        let mut surfaces = Vec::new();
        for (i, &(corners, two_sided)) in pv.iter().enumerate() {
            let first = quad(corners, Some(i as u16));
            let across = (corners[1] - corners[0]).cross(corners[2] - corners[0]).as_dvec3();
            surfaces.push(PvSurface {
                name: format!("pv/{i}"),
                entry: 0,
                triangles: vec![first, first + 1],
                normal: across.normalize(),
                area_m2: across.length(),
                two_sided,
            });
        }
        let bounds = Aabb::around(triangles.iter().flat_map(|t: &Triangle| t.corners));
        Site {
            bvh: Bvh::build(&triangles),
            triangles,
            faces,
            objects: vec![Object { id: String::new(), kind: String::new() }],
            materials: vec![Material {
                name: "grey".into(),
                reflectance: [0.25; 3],
                diffuse: true,
            }],
            pv: surfaces,
            origin: DVec3::ZERO,
            bounds,
            findings: Vec::new(),
        }
    }

    fn noon() -> Timeline {
        Timeline {
            steps: vec![Timestep {
                day: 0,
                hour: 12.0,
                sun: DVec3::new(0.3, 0.4, 0.8).normalize(),
                irradiance_w_m2: 1000.0,
                weight_h: 1.0,
                segment: 0,
            }],
            step_h: 1.0,
            year: 2025,
            half_year: false,
            sun_diameter_deg: 0.533,
            basis: SpectralBasis::Broadband,
        }
    }

    #[test]
    fn what_the_horizon_drops_reaches_nothing_and_it_drops_nearly_all_of_that() {
        let roof = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let pv = [
            // A slope to the west and its ridge, a flat roof, a façade, a free two-sided sheet.
            (
                [roof(0., 0., 4.0), roof(0., 12., 4.0), roof(-10., 12., 1.3), roof(-10., 0., 1.3)],
                false,
            ),
            ([roof(20., 0., 3.), roof(31., 0., 3.), roof(31., 9., 3.), roof(20., 9., 3.)], false),
            (
                [roof(5., -20., 0.), roof(15., -20., 0.), roof(15., -20., 7.), roof(5., -20., 7.)],
                false,
            ),
            (
                [
                    roof(-30., 20., 8.),
                    roof(-26., 20., 8.),
                    roof(-26., 25., 9.),
                    roof(-30., 25., 9.),
                ],
                true,
            ),
        ];
        let bsdf = Bsdf::from_model(&Model::Lambertian { reflectance: 0.5 }).expect("valid");
        for (seed, max_path_m) in [(3, 100.0), (4, 25.0), (5, 1000.0)] {
            let site = scene(seed, &pv);
            let timeline = noon();
            let emission = Emission {
                site: &site,
                timeline: &timeline,
                bsdfs: vec![&bsdf; 4],
                settings: Settings {
                    stored: 1000,
                    max_path_m,
                    seed,
                    sun_visibility: true,
                    receivers: Receivers::All,
                },
            };
            let tracer = Tracer::new(&emission).expect("fits");
            assert_eq!(tracer.emitters.len(), 5);
            let (mut dropped, mut missed) = (0_u32, 0_u32);
            for i in 0..60_000 {
                let mut random = Stream::new(seed, Purpose::Survey, i);
                let index = i as usize % tracer.emitters.len();
                let emitter = &tracer.emitters[index];
                let point = emitter.point(&mut random);
                // Elevations around level: there the horizon runs.
                let z = 0.8 * random.uniform() - 0.3;
                let (cos, sin) = on_circle(random.uniform());
                let level = (1.0 - z * z).sqrt();
                let direction = DVec3::new(level * cos, level * sin, z);
                if emitter.frame.z.dot(direction) <= 0.0 {
                    continue;
                }
                let horizon = tracer.horizons[index].as_ref().expect("built");
                let all = horizon.clears_all(direction);
                let here = horizon.clears(point, direction);
                let (start, towards) = (point.as_vec3(), direction.as_vec3());
                let hit = site.bvh.closest(start, towards, 0.0, max_path_m as f32);
                assert!(here || !all, "the overall horizon is the highest");
                assert!(!here || hit.is_none(), "emitter {index}, {point}, {direction}: {hit:?}");
                dropped += u32::from(here);
                missed += u32::from(hit.is_none());
            }
            let share = f64::from(dropped) / f64::from(missed);
            println!("limit {max_path_m} m: {share:.3} of {missed} misses dropped");
            assert!(share > 0.75, "{share} of the misses, limit {max_path_m}");
        }
    }
}
