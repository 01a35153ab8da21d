//! One photon from the sun to its end.
//!
//! Photon `n` of `N` belongs to a fixed position of the distribution over timesteps, emitters and
//! squares ([`super::power`]): stratified, so that each sun gets its share of photons to within
//! one, and the same photon whoever sends it. What is decided on the way, in order: the point of
//! the sun's disc, the square's direction and survival, the piece and the point that it starts
//! from, whether the sun is seen from there, and where it lands.

use std::ops::Range;

use glam::DVec3;

use super::Error;
use super::aim::{self, SharedSquares};
use super::disc::Disc;
use super::emission::{Emission, Receivers};
use super::emitter::{Emitter, emitters};
use super::horizon::{Horizon, horizons, sensor_horizons};
use super::power::{Aim, Power, Shares, Sources};
use super::virtual_sensors::{SensorTree, Through};
use super::yields::Yields;
use crate::base::{Fate, Photon, Purpose, Stream, Tally};
use crate::sky;

/// Everything that photons need, worked out once: horizons, and what falls to which timestep.
pub struct Tracer<'a> {
    pub(super) emission: &'a Emission<'a>,
    pub(super) emitters: Vec<Emitter<'a>>,
    /// What can be reached within the path limit.
    horizons: Vec<Option<Horizon>>,
    /// What can be seen at all.
    skies: Vec<Option<Horizon>>,
    shared: Vec<SharedSquares>,
    disc: Disc,
    /// See [`aim::budget`].
    budget: usize,
    pub(super) power: Power,
    max_path_m: f32,
    /// Month of each timestep from 0; empty where no crown changes with the season.
    months: Vec<u8>,
    /// Where photons are recorded that cross a virtual sensor instead of those that land.
    pub(super) sensors: Option<SensorTree>,
}

/// What a range of photons came to.
#[derive(Debug, Default)]
pub(super) struct Batch {
    pub tally: Tally,
    pub photons: Vec<Photon>,
}

/// One photon's way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    pub fate: Fate,
    /// Unit vector to the point of the sun's disc that it came from.
    pub to_sun: DVec3,
    /// See [`crate::bsdf::Scattered`].
    pub weight: f64,
    /// Flux that left the PV, W.
    pub left_w: f64,
    /// `None`: the photon died in the PV.
    pub flight: Option<Flight>,
}

/// Where a photon flew that left the PV.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flight {
    /// `None`: whatever the point, nothing is reached.
    pub start: Option<DVec3>,
    pub direction: DVec3,
    /// Distance and triangle.
    pub hit: Option<(f32, u32)>,
}

/// Which photons: of how many, and drawn for what.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draw {
    pub purpose: Purpose,
    pub seed: u64,
    pub emitted: u64,
}

impl std::fmt::Debug for Tracer<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Tracer of {} emitters", self.emitters.len())
    }
}

impl<'a> Tracer<'a> {
    /// Gets ready to send photons.
    ///
    /// # Errors
    /// What [`Emission::check`] finds, and [`Error::NoFlux`].
    pub fn new(emission: &'a Emission<'a>) -> Result<Self, Error> {
        Self::with(emission, true, None)
    }

    /// Gets ready to send photons through virtual sensors in free air: only what may cross one is
    /// sent, and what crosses is delivered, once for each virtual sensor that it crosses, instead
    /// of what lands. `settings.stored` crossings are aimed at, with `most` photons sent.
    ///
    /// # Errors What [`Emission::check`] finds, and [`Error::NoFlux`].
    pub fn through(emission: &'a Emission<'a>, sensors: &Through<'_>) -> Result<Self, Error> {
        Self::with(emission, true, Some(SensorTree::of(sensors)))
    }

    /// `cut`: whether lobes are cut into squares, or drawn as a whole.
    fn with(
        emission: &'a Emission<'a>,
        cut: bool,
        sensors: Option<SensorTree>,
    ) -> Result<Self, Error> {
        emission.check()?;
        let timeline = emission.timeline;
        let disc = Disc::new(timeline.sun_diameter_deg);
        let emitters = emitters(emission.site, &emission.bsdfs);
        let yields = Yields::of(&emitters);
        let horizons_of = |max_path_m| horizons(emission.site, &emitters, max_path_m);
        let max_path_m = emission.settings.max_path_m;
        let horizons = match &sensors {
            None => horizons_of(max_path_m),
            Some(sensors) => sensor_horizons(emission.site, &emitters, sensors.all(), max_path_m),
        };
        let pairs = emitters.len() * timeline.steps.len();
        let budget = match (cut, &sensors) {
            (false, _) => 0,
            (true, None) => aim::budget(emission.settings.stored, pairs),
            (true, Some(_)) => aim::fine_budget(emission.settings.stored, pairs),
        };
        let shared: Vec<SharedSquares> = emitters
            .iter()
            .zip(&horizons)
            .map(|(emitter, horizon)| SharedSquares::of(emitter, horizon.as_ref(), budget))
            .collect();
        let sources = Sources {
            emitters: &emitters,
            horizons: &horizons,
            shared: &shared,
            disc,
            timeline,
            budget,
        };
        let power = Power::of(&sources, &yields);
        if !above_zero(power.scatters_w) {
            return Err(Error::NoFlux { timesteps: timeline.steps.len() });
        }
        let skies = horizons_of(f64::INFINITY);
        let max_path_m = emission.settings.max_path_m as f32;
        let month = |day| sky::date_of_day(timeline.year, day).0.saturating_sub(1) as u8;
        let months = match &emission.site.crowns {
            Some(_) => timeline.steps.iter().map(|s| month(s.day)).collect(),
            None => Vec::new(),
        };
        Ok(Self {
            emission,
            emitters,
            horizons,
            skies,
            shared,
            disc,
            budget,
            power,
            max_path_m,
            months,
            sensors,
        })
    }

    /// Watts that all photons carry together.
    pub(super) fn total_w(&self) -> f64 {
        self.power.total_w()
    }

    /// The tally of a run of no photons: all that is scattered reaches nothing.
    pub(super) fn dark(&self) -> Tally {
        let mut tally = Tally::default();
        tally.close(self.power.falls_w, self.power.scatters_w);
        tally
    }

    pub(super) fn sources(&self) -> Sources<'_> {
        Sources {
            emitters: &self.emitters,
            horizons: &self.horizons,
            shared: &self.shared,
            disc: self.disc,
            timeline: self.emission.timeline,
            budget: self.budget,
        }
    }

    /// Sends photons `numbers` of `draw.emitted`.
    pub(super) fn send(&self, draw: Draw, numbers: Range<u64>, keep: bool) -> Batch {
        let mut out = Batch::default();
        let sent = (numbers.end - numbers.start) as f64;
        let each_w = self.power.total_w() / draw.emitted as f64;
        let sources = self.sources();
        let mut current = Shares::of(&sources, self.power.find(numbers.start as f64 * each_w));
        let mut near = 0;
        for number in numbers {
            let mut random = Stream::new(draw.seed, draw.purpose, number);
            let at_w = (number as f64 + random.uniform()) * each_w;
            let step = self.power.step_at(at_w, current.step);
            if step != current.step {
                current = Shares::of(&sources, step);
                near = 0;
            }
            match current.at(at_w - self.power.before_w(step), &mut near) {
                Some(aim) => {
                    let path = self.follow(&current, aim, each_w, &mut random);
                    out.tally.book(path.fate, path.left_w);
                    out.tally.over_bound += u64::from(path.weight > 1.0);
                    match &self.sensors {
                        _ if !keep => {}
                        None => out.photons.extend(self.photon(&current, aim, &path)),
                        Some(sensors) => {
                            self.crossings(sensors, &current, aim, &path, &mut out.photons);
                        }
                    }
                }
                None => out.tally.book(Fate::Blocked, 0.0),
            }
        }
        // Each photon stands for as much as any other of what fell onto the PV.
        let share = sent / draw.emitted as f64;
        out.tally.close(share * self.power.falls_w, share * self.power.scatters_w);
        out
    }

    /// Follows one photon from the sun to its end.
    #[inline]
    pub(super) fn follow(
        &self,
        shares: &Shares,
        aim: &Aim,
        each_w: f64,
        random: &mut Stream,
    ) -> Path {
        let emitter = &self.emitters[aim.emitter];
        let to_sun = self.disc.direction(&shares.sun, random.uniform(), random.uniform());
        let incident = emitter.frame.local_from_world(to_sun);
        let ended = |fate| Path { fate, to_sun, weight: 1.0, left_w: 0.0, flight: None };
        if incident.z <= 0.0 || to_sun.z <= 0.0 {
            return ended(Fate::Blocked);
        }
        let bound = aim.target.most / incident.z;
        let Some(scattered) = emitter.bsdf.draw(aim.target.square, incident, bound, random) else {
            return ended(Fate::Absorbed);
        };
        let left_w = each_w * scattered.weight;
        let direction = emitter.frame.world_from_local(scattered.direction);
        let piece = emitter.piece(aim.target.pieces, aim.target.share, random);
        let mut flight = Flight { start: None, direction, hit: None };
        let clear = self.horizons[aim.emitter].as_ref().is_some_and(|h| h.clears(piece, direction));
        let fate = if clear {
            Fate::NotSampled
        } else {
            let start = emitter.point(piece, random);
            flight.start = Some(start);
            let ways = (to_sun, direction);
            let crosses = |reach_m: f32| {
                self.sensors
                    .as_ref()
                    .is_none_or(|sensors| sensors.crossed(start, direction, reach_m))
            };
            if crosses(self.max_path_m) {
                let (fate, hit) = self.fly((aim.emitter, piece), start, ways, shares.step, random);
                flight.hit = hit;
                match &self.sensors {
                    Some(_) if fate != Fate::Blocked => {
                        match crosses(hit.map_or(self.max_path_m, |(distance_m, _)| distance_m)) {
                            true => Fate::Stored,
                            false => Fate::Escaped,
                        }
                    }
                    _ => fate,
                }
            } else {
                Fate::NotSampled
            }
        };
        Path { fate, to_sun, weight: scattered.weight, left_w, flight: Some(flight) }
    }

    /// What is stored of a photon, if it is.
    #[inline]
    pub(super) fn photon(&self, shares: &Shares, aim: &Aim, path: &Path) -> Option<Photon> {
        if path.fate != Fate::Stored {
            return None;
        }
        let flight = path.flight.as_ref()?;
        let (start, (distance_m, triangle)) = (flight.start?, flight.hit?);
        let towards = flight.direction.as_vec3();
        let normal = self.emission.site.triangles[triangle as usize].normal();
        Some(Photon {
            position: (start + flight.direction * f64::from(distance_m)).as_vec3(),
            normal: if normal.dot(towards) > 0.0 { -normal } else { normal },
            direction: -towards,
            flux_w: path.left_w as f32,
            timestep: shares.step as u32,
            surface: self.emitters[aim.emitter].surface,
        })
    }

    /// What is recorded of a photon at the virtual sensors that it crosses before it lands.
    #[inline]
    fn crossings(
        &self,
        sensors: &SensorTree,
        shares: &Shares,
        aim: &Aim,
        path: &Path,
        out: &mut Vec<Photon>,
    ) {
        let Some(flight) = path.flight.as_ref().filter(|_| path.fate == Fate::Stored) else {
            return;
        };
        let Some(start) = flight.start else { return };
        let reach_m = flight.hit.map_or(self.max_path_m, |(distance_m, _)| distance_m);
        sensors.each_crossed(start, flight.direction, reach_m, |position, normal| {
            out.push(Photon {
                position,
                normal,
                direction: -flight.direction.as_vec3(),
                flux_w: path.left_w as f32,
                timestep: shares.step as u32,
                surface: self.emitters[aim.emitter].surface,
            });
        });
    }

    /// The way to the sun, and the flight: what becomes of the photon, and if it hits something
    /// within the limit, how far it flew and which triangle. A crown that lets part of the light
    /// through stops that part of the photons: so all keep the same flux.
    fn fly(
        &self,
        (emitter, piece): (usize, usize),
        point: DVec3,
        (to_sun, direction): (DVec3, DVec3),
        step: usize,
        random: &mut Stream,
    ) -> (Fate, Option<(f32, u32)>) {
        let site = self.emission.site;
        let (start, towards) = (point.as_vec3(), direction.as_vec3());
        let settings = &self.emission.settings;
        let open = |d| self.skies[emitter].as_ref().is_some_and(|sky| sky.clears(piece, d));
        let month = self.months.get(step).map_or(0, |m| usize::from(*m));
        if settings.sun_visibility && !open(to_sun) {
            let to_sun = to_sun.as_vec3();
            let free = match &site.crowns {
                None => !site.bvh.occluded(start, to_sun, 0.0, f32::INFINITY),
                Some(crowns) => crowns.passes(start, to_sun, month, || random.uniform()),
            };
            if !free {
                return (Fate::Blocked, None);
            }
        }
        let reach_m = self.max_path_m;
        let met = match &site.crowns {
            None => site.bvh.closest(start, towards, 0.0, reach_m),
            Some(crowns) => crowns.closest(start, towards, reach_m, month, || random.uniform()),
        };
        let Some(hit) = met else {
            let beyond = !open(direction)
                && site.bvh.occluded(start, towards, self.max_path_m, f32::INFINITY);
            return (if beyond { Fate::TooFar } else { Fate::Escaped }, None);
        };
        let face = site.face_of(hit.triangle);
        let landed = Some((hit.distance_m, hit.triangle));
        if face.pv.is_some() {
            return (Fate::OnPv, landed);
        }
        let kept = match settings.receivers {
            Receivers::All => true,
            Receivers::Diffuse => site.materials[face.material as usize].diffuse,
        };
        (if kept { Fate::Stored } else { Fate::Escaped }, landed)
    }
}

fn above_zero(x: f64) -> bool {
    x.partial_cmp(&0.0) == Some(std::cmp::Ordering::Greater)
}

#[cfg(test)]
mod tests;
