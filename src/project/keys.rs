//! What decides each unit of work, as one hash: its key.
//!
//! A unit of work is made again when its key isn't the one that it was made from. So a key must
//! change with every setting that changes the result, and it should change with nothing else. Two
//! things see to the first. A key hashes whole settings as they are serialised, structs that the
//! rooms take or tables of the project file, never a choice of numbers by hand; a new field is in
//! the key without anybody thinking of it. And wherever only a part of a struct decides, the struct
//! is taken apart without `..`, so that a new field doesn't compile until somebody says whether it
//! counts. What a unit is made of is named by the keys of the units that made it.
//!
//! A key knows files by their names and contents, never by where they lie: a project may be moved.
//!
//! Lost: tuples of numbers, each written where it was used. Three settings were forgotten that way
//! (the time zone of event tables, mantissa bits of direct series, the photons that tell which
//! surface sends an event), and nothing could notice.

use std::collections::BTreeMap;
use std::io;

use serde::Serialize;

use super::error::Error;
use super::resolve::{Candidate, Made, PlannedMoment, Resolved};
use super::tables::{FileEntry, Project, PvTable, SceneTable, SiteTable};
use super::view_tables::{ObserverTable, RegionTable};
use super::views::{Estimator, PhotonGather, PlannedView, Points, SeriesKept, Target};
use crate::base::Irradiance;
use crate::base::Provenance;
use crate::glare;
use crate::rules::{Class, Profile};
use crate::site::Season;
use crate::sky::{FarHorizon, Place, TimeSpec};
use crate::trace;

/// The keys of a plan. Those of the scene and the suns, which all others are made from, are ready.
#[derive(Clone, Debug)]
pub struct Keys<'a> {
    resolved: &'a Resolved,
    /// Of what stands there.
    pub scene: String,
    /// Of the timesteps.
    pub suns: String,
}

/// `made_from`: the keys of what the unit is made from.
fn key<K: AsRef<str>>(
    what: &str,
    made_from: &[K],
    settings: &impl Serialize,
) -> Result<String, Error> {
    let made_from: Vec<&str> = made_from.iter().map(AsRef::as_ref).collect();
    let json = serde_json::to_vec(&(Provenance::PROGRAM, what, made_from, settings))
        .map_err(io::Error::from)?;
    Ok(blake3::hash(&json).to_hex().to_string())
}

#[derive(Serialize)]
struct SceneSettings<'a> {
    /// Files by their names: their contents are among the inputs.
    scene: SceneTable,
    pv: &'a [PvTable],
    seasons: &'a [Season],
    inputs: &'a BTreeMap<String, String>,
    /// By the projection of a map the site's place says where north lies.
    convergence_at: Option<[f64; 2]>,
}

#[derive(Serialize)]
struct SunSettings<'a> {
    place: &'a Place,
    times: &'a TimeSpec,
    /// Hash of the weather file.
    weather: &'a Option<String>,
    horizon: &'a Option<FarHorizon>,
}

#[derive(Serialize)]
struct PhotonSettings<'a> {
    models: &'a [Made],
    trace: &'a trace::Settings,
}

#[derive(Serialize)]
struct TargetSettings<'a> {
    target: &'a Target,
    max_path_m: f64,
    seed: u64,
    /// Of the set of receivers: all but their classes.
    observers: Vec<ObserverTable>,
    regions: Vec<RegionTable>,
}

#[derive(Serialize)]
struct MapSettings<'a> {
    /// Names stand in files, titles and legends.
    material: &'a str,
    view: &'a str,
    gather: &'a PhotonGather,
}

#[derive(Serialize)]
struct RenderSettings<'a> {
    material: &'a str,
    view: &'a str,
    /// Where it isn't made of photons, which know them.
    models: Option<&'a [Made]>,
    estimator: &'a Estimator,
    series: SeriesKept,
    mantissa_bits: u32,
    quantity: Irradiance,
}

#[derive(Serialize)]
struct GlareSettings<'a> {
    threshold: f64,
    sigma: [f64; 3],
    truncate: f64,
    neighbours: u32,
    clock: Clock<'a>,
}

/// What civil time depends on.
#[derive(Serialize)]
struct Clock<'a> {
    timezone: &'a Option<String>,
    meridian_deg: f64,
}

#[derive(Serialize)]
struct ReceivedSettings<'a> {
    /// Outdoors not all times count.
    classes: Vec<Option<Class>>,
    clock: Clock<'a>,
}

#[derive(Serialize)]
struct Material<'a> {
    name: &'a str,
    models: &'a [Made],
}

#[derive(Serialize)]
struct EyeSettings<'a> {
    materials: Vec<Material<'a>>,
    observers: &'a [ObserverTable],
    thresholds_w_m2: &'a [f64],
    quantity: Irradiance,
    /// Along time; an eye has no neighbours.
    sigma: f64,
    truncate: f64,
    clock: Clock<'a>,
}

#[derive(Serialize)]
struct MomentSettings<'a> {
    materials: Vec<Material<'a>>,
    moments: &'a [PlannedMoment],
    observers: &'a [ObserverTable],
    site: &'a str,
    clock: Clock<'a>,
}

/// What is told of a site beside what was computed.
#[derive(Serialize)]
struct ToldSettings<'a> {
    site: &'a str,
    clock: Clock<'a>,
    observers: &'a [ObserverTable],
    regions: &'a [RegionTable],
    reference: Option<&'a str>,
    /// None of pictures: they hold no verdict.
    rules: &'a [Profile],
}

impl<'a> Keys<'a> {
    /// The keys of a plan.
    ///
    /// # Errors
    /// When settings can't be hashed (numbers that aren't finite).
    pub fn of(resolved: &'a Resolved) -> Result<Self, Error> {
        let Resolved { place, times, weather, horizon, inputs, project, scene, .. } = resolved;
        let Project { pv, scene: table, .. } = project;
        let mut table = table.clone();
        table.files = table.files.iter().map(FileEntry::without_folder).collect();
        let scene = SceneSettings {
            scene: table,
            pv,
            seasons: &scene.seasons,
            inputs,
            convergence_at: scene.convergence_at,
        };
        let suns = SunSettings { place, times, weather, horizon };
        Ok(Self {
            resolved,
            scene: key::<&str>("scene", &[], &scene)?,
            suns: key::<&str>("suns", &[], &suns)?,
        })
    }

    /// A candidate's photons.
    ///
    /// # Errors
    /// See [`Keys::of`]; so of all that follow.
    pub fn photons(&self, candidate: &Candidate) -> Result<String, Error> {
        let settings = PhotonSettings { models: &candidate.models, trace: &self.resolved.trace };
        key("photons", &[&self.scene, &self.suns], &settings)
    }

    /// A candidate's photon store.
    pub fn pages(&self, photons: &str) -> Result<String, Error> {
        key("pages", &[photons], &())
    }

    /// What the pixels of a view, or the points of a set, see. `seen`: of receivers, the hits of
    /// the pictures in which regions are drawn.
    pub fn hits(&self, view: &PlannedView, seen: &[&str]) -> Result<String, Error> {
        let trace::Settings { stored: _, max_path_m, seed, sun_visibility: _, receivers: _ } =
            self.resolved.trace;
        let mut settings = TargetSettings {
            target: &view.target,
            max_path_m,
            seed,
            observers: Vec::new(),
            regions: Vec::new(),
        };
        if matches!(view.target, Target::Points(Points::Receivers)) {
            let Project { observer, region, .. } = &self.resolved.project;
            settings.observers =
                observer.iter().map(|o| ObserverTable { class: None, ..o.clone() }).collect();
            settings.regions =
                region.iter().map(|r| RegionTable { class: None, ..r.clone() }).collect();
        }
        key("hits", &[&[self.scene.as_str()], seen].concat(), &settings)
    }

    /// A view's daylight background.
    pub fn background(&self, hits: &str) -> Result<String, Error> {
        key("direct", &[hits, self.suns.as_str()], &())
    }

    /// The photons that cross the discs of a set's points in free air.
    pub fn air(&self, photons: &str, hits: &str, gather: &PhotonGather) -> Result<String, Error> {
        key("air", &[photons, hits], gather)
    }

    /// A candidate's maps of the year in a view, from photons.
    pub fn annual(
        &self,
        candidate: &Candidate,
        view: &PlannedView,
        gather: &PhotonGather,
        made_from: &[String],
    ) -> Result<String, Error> {
        let PhotonGather { annual, series_bandwidth: _, series_edges: _ } = *gather;
        let gather = &PhotonGather { annual, ..PhotonGather::default() };
        let settings = MapSettings { material: &candidate.name, view: &view.name, gather };
        key("annual", made_from, &settings)
    }

    /// A candidate's series in a view, and, of what is integrated, its maps of the year.
    pub fn render(
        &self,
        candidate: &Candidate,
        view: &PlannedView,
        made_from: &[String],
    ) -> Result<String, Error> {
        let PlannedView { name, target: _, estimator, series, mantissa_bits } = view;
        let settings = RenderSettings {
            material: &candidate.name,
            view: name,
            models: view.is_direct().then_some(&candidate.models),
            estimator,
            series: *series,
            mantissa_bits: *mantissa_bits,
            quantity: self.resolved.quantity,
        };
        let made_from = [&[self.scene.clone(), self.suns.clone()], made_from].concat();
        key("render", &made_from, &settings)
    }

    /// A glare analysis.
    pub fn glare(&self, threshold: f64, made_from: &[String]) -> Result<String, Error> {
        // Memory decides about no number, and the threshold is filled in for each.
        let glare::Settings {
            threshold: _,
            sigma,
            truncate,
            connectivity,
            allow_nonfinite: _,
            memory_bytes: _,
            spill: _,
        } = self.resolved.glare;
        let neighbours = connectivity.neighbours();
        let clock = self.clock();
        key("glare", made_from, &GlareSettings { threshold, sigma, truncate, neighbours, clock })
    }

    /// What is read off a set of points.
    pub fn received(&self, made_from: &[String]) -> Result<String, Error> {
        let Project { observer, region, .. } = &self.resolved.project;
        let classes =
            observer.iter().map(|o| o.class).chain(region.iter().map(|r| r.class)).collect();
        key("received", made_from, &ReceivedSettings { classes, clock: self.clock() })
    }

    /// What the observers' eyes see, of all materials.
    pub fn eyes(&self) -> Result<String, Error> {
        let glare = &self.resolved.glare;
        let settings = EyeSettings {
            materials: self.materials(),
            observers: &self.resolved.project.observer,
            thresholds_w_m2: &self.resolved.project.glare.thresholds_w_m2,
            quantity: self.resolved.quantity,
            sigma: glare.sigma[0],
            truncate: glare.truncate,
            clock: self.clock(),
        };
        key("eyes", &[&self.scene, &self.suns], &settings)
    }

    /// The pictures of luminances.
    pub fn moments(&self) -> Result<String, Error> {
        let Project { site, observer, .. } = &self.resolved.project;
        let settings = MomentSettings {
            materials: self.materials(),
            moments: &self.resolved.moments,
            observers: observer,
            site: &site.name,
            clock: self.clock(),
        };
        key("moments", &[&self.scene, &self.suns], &settings)
    }

    /// Everything that is drawn decides about the pictures, because they share their scales.
    pub fn pictures(&self, made_from: &[&str]) -> Result<String, Error> {
        key("pictures", made_from, &ToldSettings { rules: &[], ..self.told() })
    }

    /// What the rules say of observers and regions.
    pub fn verdicts(&self, made_from: &[&str]) -> Result<String, Error> {
        key("verdicts", made_from, &self.told())
    }

    /// The document.
    pub fn report(&self, made_from: &[&str]) -> Result<String, Error> {
        key("report", made_from, &self.told())
    }

    fn told(&self) -> ToldSettings<'a> {
        let Project { site, observer, region, reference, .. } = &self.resolved.project;
        ToldSettings {
            site: &site.name,
            clock: self.clock(),
            observers: observer,
            regions: region,
            reference: reference.as_ref().map(|t| t.material.as_str()),
            rules: &self.resolved.rules,
        }
    }

    fn materials(&self) -> Vec<Material<'a>> {
        let of = |c: &'a Candidate| Material { name: &c.name, models: &c.models };
        self.resolved.candidates.iter().map(of).collect()
    }

    fn clock(&self) -> Clock<'a> {
        let SiteTable {
            name: _,
            latitude: _,
            longitude: _,
            meridian,
            timezone,
            elevation_m: _,
            horizon: _,
        } = &self.resolved.project.site;
        Clock { timezone, meridian_deg: *meridian }
    }
}
