//! The plan of a run: what the project file says, checked and in the rooms' own words, and the
//! keys that say what decides each output.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::error::Error;
use super::manifest::key_of;
use super::project::{self, FileEntry, Project};
use super::reader::Reader;
use super::set::Assignment;
use crate::base::Timeline;
use crate::glare;
use crate::glare::rules::Profile;
use crate::render::sensors::Sensor;
use crate::render::{Gather, Quantity, View};
use crate::site::bsdf::{Bsdf, Model, Side, Spectrum};
use crate::site::{PvSpec, SceneSpec};
use crate::sky::{self, DayRange, FarHorizon, HourRange, Place, TimeSpec};
use crate::trace;

/// Below this many stored photons verdicts and pictures are marked as a draft.
pub const DRAFT_BELOW_PHOTONS: u64 = 4_000_000;

/// What a material is made from: all that decides how it scatters.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Made {
    /// A model.
    Model(Model),
    /// A side of a file.
    File {
        /// Hash of the file.
        bsdf: String,
        /// Its name, without its folder.
        #[serde(skip)]
        name: String,
        /// The side.
        side: Side,
        /// The light that was asked for.
        spectrum: Option<Spectrum>,
    },
}

/// A candidate: what each PV entry is made of.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Names the folder of its results.
    pub name: String,
    /// Model or file of each `[[pv]]` entry, in the order of the project file.
    pub models: Vec<Made>,
    /// The same, ready to scatter.
    pub bsdfs: Vec<Bsdf>,
    /// What its files leave to be desired, for people.
    pub notes: Vec<String>,
}

/// A view and how it is rendered.
#[derive(Clone, Debug)]
pub struct PlannedView {
    /// Names the folder of its results.
    pub name: String,
    /// As written.
    pub options: String,
    /// The camera.
    pub view: View,
    /// How the annual map is gathered.
    pub annual: Gather,
    /// Analysed as rendered: no series is kept.
    pub fuse: bool,
    /// The other irradiance gets a series, too.
    pub both: bool,
    /// How the series is gathered; its bandwidth is fixed once the timesteps are known.
    pub series_bandwidth: Option<usize>,
    /// Whether the discs of the series end where those of the annual map do.
    pub series_edges: bool,
    /// Whether it is integrated directly, without photons.
    pub direct: bool,
    /// Points instead of pixels: `view` then means nothing, and the hits say how many there are.
    pub points: Option<Points>,
}

/// A picture of luminances.
#[derive(Clone, Debug, Serialize)]
pub struct PlannedMoment {
    /// Names its files.
    pub name: String,
    /// Day of the year, 0 is 1 January.
    pub day: u32,
    /// Local standard time, h.
    pub hour: f64,
    /// The camera, as Radiance's options; an observer's without its place.
    pub camera: Camera,
    /// Width and height, pixels.
    pub size: [usize; 2],
}

/// From where a picture of luminances is taken.
#[derive(Clone, Debug, Serialize)]
pub enum Camera {
    /// Radiance's view options.
    Options(String),
    /// An observer's number: along its direction, or half a sphere around it.
    Observer {
        /// Its number in the project file.
        number: usize,
        /// Half a sphere.
        fisheye: bool,
    },
}

/// Where the points of a set of sensors come from.
#[derive(Clone, Debug, Serialize)]
pub enum Points {
    /// A file of `[[view]] sensors`.
    File {
        /// Hash of the file.
        hash: String,
        /// What it holds.
        #[serde(skip)]
        sensors: Vec<Sensor>,
        /// Whether that is in map coordinates.
        map: bool,
    },
    /// All `[[observer]]`s and `[[region]]`s.
    Receivers,
}

/// Points of a region, about, before it is looked up in the scene.
const POINTS_OF_A_REGION: usize = 500;
/// The set of all observers and regions.
pub const RECEIVERS: &str = "receivers";
/// The folder of the pictures of luminances.
pub const MOMENTS: &str = "moments";

/// A project, checked, with all defaults filled in.
#[derive(Clone, Debug)]
pub struct Resolved {
    /// `project.toml`.
    pub file: PathBuf,
    /// The folder it lies in.
    pub folder: PathBuf,
    /// As written, with defaults.
    pub project: Project,
    /// Where on Earth.
    pub place: Place,
    /// Which instants.
    pub times: TimeSpec,
    /// Which files.
    pub scene: SceneSpec,
    /// Which PV.
    pub pv: Vec<PvSpec>,
    /// Materials and cases.
    pub candidates: Vec<Candidate>,
    /// Index of the reference among the candidates.
    pub reference: Option<usize>,
    /// The pictures.
    pub views: Vec<PlannedView>,
    /// Sets of points that are rendered and analysed as the pictures are; the last one is that of
    /// the observers and regions, if there are any.
    pub sensors: Vec<PlannedView>,
    /// Pictures of luminances.
    pub moments: Vec<PlannedMoment>,
    /// How photons are traced.
    pub trace: trace::Settings,
    /// What is compared with the thresholds.
    pub quantity: Quantity,
    /// How glare is found; the threshold is filled in for each.
    pub glare: glare::Settings,
    /// What it is judged by.
    pub rules: Vec<Profile>,
    /// Ridges beyond the scene.
    pub horizon: Option<FarHorizon>,
    /// Hash of each input file by its name.
    pub inputs: BTreeMap<String, String>,
    /// Hash of the weather file, where there is one.
    pub weather: Option<String>,
}

impl Resolved {
    /// Reads and checks a project; `memory_bytes` bounds the analysis.
    ///
    /// # Errors
    /// Any mistake in the project file, with its key; missing input files.
    pub fn read(path: &Path, set: &[Assignment], memory_bytes: u64) -> Result<Self, Error> {
        let (file, project) = project::read(path, set)?;
        let folder = file.parent().map_or_else(PathBuf::new, Path::to_owned);
        let r = Reader { file: &file, project: &project };
        r.names()?;
        let candidates = r.candidates()?;
        let reference = r.reference(&candidates)?;
        let inputs = r.inputs(&folder)?;
        let resolved = Self {
            place: r.place()?,
            times: r.times()?,
            horizon: r.horizon()?,
            scene: r.scene(&folder)?,
            pv: r.pv()?,
            views: r.views()?,
            sensors: r.sensors()?,
            rules: r.rules()?,
            moments: r.moments()?,
            trace: r.trace()?,
            quantity: r.quantity()?,
            glare: r.glare(memory_bytes)?,
            weather: r.weather()?,
            candidates,
            reference,
            inputs,
            folder: folder.clone(),
            file: file.clone(),
            project,
        };
        // Known now, not when all photons are traced.
        for moment in &resolved.moments {
            resolved.instant(moment)?;
        }
        Ok(resolved)
    }

    /// The pictures, then the sets of points.
    pub fn with_sensors(&self) -> impl Iterator<Item = &PlannedView> {
        self.views.iter().chain(&self.sensors)
    }

    /// How many pixels a view has, or points a set; of regions about how many, as that is known
    /// once they are looked up in the scene.
    pub fn pixels(&self, view: &PlannedView) -> usize {
        match &view.points {
            None => view.view.columns() * view.view.rows(),
            Some(Points::File { sensors, .. }) => sensors.len(),
            Some(Points::Receivers) => {
                self.project.observer.len() + POINTS_OF_A_REGION * self.project.region.len()
            }
        }
    }

    /// Where results lie.
    pub fn run_folder(&self) -> PathBuf {
        self.folder.join("run")
    }

    /// Whether the run is marked as a draft.
    pub fn is_draft(&self) -> bool {
        self.needs_photons() && self.trace.stored < DRAFT_BELOW_PHOTONS
    }

    /// Whether pictures of a view, or charts of a set of points, are marked as a draft.
    pub fn is_draft_of(&self, view: &PlannedView) -> bool {
        self.is_draft() && !view.direct
    }

    /// Whether any view, sensor, observer or region is made of photons; without any of them photons
    /// are all there is.
    pub fn needs_photons(&self) -> bool {
        let mut all = self.with_sensors();
        all.next().is_none_or(|first| !first.direct || all.any(|v| !v.direct))
    }

    /// Number of thresholds that glare is analysed at.
    pub fn glare_thresholds(&self) -> usize {
        self.project.glare.thresholds_w_m2.len()
    }

    /// Hash of each file that decides an output, by its name: of the scene, and where it is a
    /// material's, of its BSDF files and the weather.
    pub fn inputs_of(&self, about: &[(&str, &str)]) -> BTreeMap<String, String> {
        let mut inputs = self.inputs.clone();
        let name = about.iter().find(|(key, _)| *key == "material").map(|(_, name)| *name);
        let Some(candidate) = self.candidates.iter().find(|c| Some(c.name.as_str()) == name) else {
            return inputs;
        };
        let mut add = |name: String, hash: &String| {
            let mut free = name.clone();
            let mut number = 1;
            while inputs.get(&free).is_some_and(|known| known != hash) {
                number += 1;
                free = format!("{name} ({number})");
            }
            inputs.insert(free, hash.clone());
        };
        for made in &candidate.models {
            if let Made::File { bsdf, name, .. } = made {
                add(name.clone(), bsdf);
            }
        }
        if let Some(hash) = &self.weather {
            add("weather".to_owned(), hash);
        }
        inputs
    }

    /// What decides the scene.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn scene_key(&self) -> Result<String, Error> {
        let mut scene = self.project.scene.clone();
        // Where a file lies must not change what a run writes; its name is among the inputs.
        for entry in &mut scene.files {
            let (FileEntry::Path(path) | FileEntry::Table { path, .. }) = entry;
            *path = path.file_name().unwrap_or_default().into();
        }
        // By the projection the site's place says where north lies.
        let place = self.scene.convergence_at;
        let scene = (scene, &self.project.pv, &self.inputs, place);
        match self.scene.seasons.as_slice() {
            [] => key_of("scene", &scene),
            seasons => key_of("scene", &(scene, seasons)),
        }
    }

    /// The timesteps: the suns above the horizon, the far one as well.
    ///
    /// # Errors
    /// See [`sky::timeline`].
    pub fn timeline(&self) -> Result<Timeline, Error> {
        let timeline = sky::timeline(&self.place, &self.times)?;
        Ok(match &self.horizon {
            None => timeline,
            Some(horizon) => horizon.cut(timeline)?,
        })
    }

    /// The timeline of a picture of luminances: its one instant.
    ///
    /// # Errors
    /// [`Error::Project`], with the picture's name, where the sun stands below the horizon or the
    /// weather holds nothing for it.
    pub fn instant(&self, moment: &PlannedMoment) -> Result<Timeline, Error> {
        let spec = TimeSpec {
            days: DayRange { from: moment.day, to: moment.day, step: 1 },
            hours: HourRange { from: moment.hour, to: moment.hour, step: 0.25 },
            finer: Vec::new(),
            half_year: false,
            ..self.times.clone()
        };
        let timeline = sky::timeline(&self.place, &spec);
        let timeline = match &self.horizon {
            None => timeline,
            Some(horizon) => timeline.and_then(|t| horizon.cut(t)),
        };
        timeline.map_err(|e| Error::Project {
            path: self.file.clone(),
            line: 0,
            column: 0,
            message: match e {
                sky::Error::Night { .. } => {
                    format!("[[moment]] \"{}\": the sun is below the horizon then", moment.name)
                }
                other => format!("[[moment]] \"{}\": {other}", moment.name),
            },
        })
    }

    /// What decides the timesteps.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn suns_key(&self) -> Result<String, Error> {
        let s = &self.project.site;
        let place = (s.latitude, s.longitude, s.meridian, s.elevation_m);
        // Not the weather's path: where a file lies must not change what a run writes.
        let mut time = self.project.time.clone();
        if let Some(hash) = &self.weather {
            time.irradiance = toml::Value::String(hash.clone());
        }
        match &self.horizon {
            None => key_of("suns", &(place, time)),
            Some(horizon) => key_of("suns", &(place, time, horizon)),
        }
    }

    /// What decides a candidate's photons.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn photons_key(&self, candidate: &Candidate) -> Result<String, Error> {
        let upstream = (self.scene_key()?, self.suns_key()?);
        key_of("photons", &(upstream, &candidate.models, &self.project.photons))
    }

    /// What decides a view's hits.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn hits_key(&self, view: &PlannedView) -> Result<String, Error> {
        match &view.points {
            None => {}
            Some(file @ Points::File { .. }) => {
                let path_m = (self.trace.max_path_m, self.trace.seed);
                return key_of("sensors", &(self.scene_key()?, path_m, file));
            }
            Some(Points::Receivers) => return self.receivers_key(),
        }
        #[derive(Serialize)]
        struct Facts<'a> {
            scene: String,
            view: &'a str,
            size: (usize, usize),
            max_path_m: f64,
            seed: u64,
        }
        key_of(
            "hits",
            &Facts {
                scene: self.scene_key()?,
                view: &view.options,
                size: (view.view.columns(), view.view.rows()),
                max_path_m: self.trace.max_path_m,
                seed: self.trace.seed,
            },
        )
    }

    /// What decides the points of the observers and regions: all but their classes.
    fn receivers_key(&self) -> Result<String, Error> {
        let p = &self.project;
        let observers: Vec<_> = p
            .observer
            .iter()
            .map(|o| project::ObserverTable { class: None, ..o.clone() })
            .collect();
        let regions: Vec<_> =
            p.region.iter().map(|r| project::RegionTable { class: None, ..r.clone() }).collect();
        // Polygons in pictures mean what the pictures see.
        let seen = p
            .region
            .iter()
            .filter_map(|r| self.views.iter().find(|v| Some(&v.name) == r.view.as_ref()))
            .map(|v| self.hits_key(v))
            .collect::<Result<Vec<_>, _>>()?;
        let trace = (self.trace.max_path_m, self.trace.seed);
        key_of("receivers", &(self.scene_key()?, trace, observers, regions, seen))
    }

    /// What decides a candidate's maps and series in a view.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn render_key(&self, candidate: &Candidate, view: &PlannedView) -> Result<String, Error> {
        let g = &view.annual;
        if view.direct {
            let p = &self.project.photons;
            let scene = (self.scene_key()?, self.suns_key()?, &candidate.models);
            let sight = (p.max_path_m, p.sun_visibility);
            let how = ("direct", sight, (view.both, view.fuse), self.hits_key(view)?);
            let names = (&candidate.name, &view.name);
            return key_of("render", &(scene, how, &self.project.glare.quantity, names));
        }
        let upstream = (self.photons_key(candidate)?, self.hits_key(view)?);
        let estimator = format!("{:?} {:?}", g.estimator, g.kernel);
        let surface = (g.normal_tolerance_deg, g.plane_tolerance_m, g.edges);
        let photons = (estimator, g.bandwidth, view.series_bandwidth, g.max_radius_m);
        let series = (view.series_edges, view.fuse, view.both, g.mantissa_bits);
        let how = (photons, surface, series);
        // The names stand in the files, in titles and in legends.
        let names = (&candidate.name, &view.name);
        key_of("render", &(upstream, how, &self.project.glare.quantity, names))
    }

    /// What decides a glare analysis.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn glare_key(&self, render_key: &str, threshold: f64) -> Result<String, Error> {
        let g = &self.project.glare;
        key_of("glare", &(render_key, threshold, g.sigma, g.truncate, g.connectivity))
    }

    /// What decides what the observers' eyes see, of all materials; `None` where nobody looks.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn eyes_key(&self) -> Result<Option<String>, Error> {
        let p = &self.project;
        if p.observer.is_empty() {
            return Ok(None);
        }
        let upstream = (self.scene_key()?, self.suns_key()?);
        let made: Vec<_> = self.candidates.iter().map(|c| (&c.name, &c.models)).collect();
        let g = &p.glare;
        let judged = (&g.thresholds_w_m2, &g.quantity, g.sigma[0], g.truncate);
        let clock = (&p.site.timezone, p.site.meridian);
        key_of("eyes", &(upstream, made, &p.observer, judged, clock)).map(Some)
    }

    /// What decides the pictures of luminances; `None` where there are none.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn moments_key(&self) -> Result<Option<String>, Error> {
        if self.moments.is_empty() {
            return Ok(None);
        }
        let upstream = (self.scene_key()?, self.suns_key()?);
        let made: Vec<_> = self.candidates.iter().map(|c| (&c.name, &c.models)).collect();
        let told = (&self.project.site.name, &self.project.site.timezone);
        key_of("moments", &(upstream, made, &self.moments, &self.project.observer, told)).map(Some)
    }

    /// What decides what is read off a set of points.
    ///
    /// # Errors
    /// When the settings can't be hashed.
    pub fn received_key(&self, candidate: &Candidate, set: &PlannedView) -> Result<String, Error> {
        let render = self.render_key(candidate, set)?;
        let thresholds = &self.project.glare.thresholds_w_m2;
        let glare: Vec<String> =
            thresholds.iter().map(|t| self.glare_key(&render, *t)).collect::<Result<_, _>>()?;
        // Dates and clock times stand in the tables; outdoors not all of them count.
        let p = &self.project;
        let observers = p.observer.iter().map(|o| o.class);
        let classes: Vec<_> = observers.chain(p.region.iter().map(|r| r.class)).collect();
        key_of("received", &(glare, classes, &p.site.timezone, p.site.meridian))
    }
}
