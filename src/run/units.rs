//! The units of work of a plan: what a run makes, piece by piece.
//!
//! A unit has a stage, a name, a key (what decides it, see [`keys`](crate::project::keys)) and the
//! [`Work`] that makes it. All of them are made here, once, in the order in which they run; a stage
//! is handed its unit and does the work, and the runner alone asks whether a unit is current,
//! records it and forgets what is stale. So whoever wants to know what the program makes, in which
//! order and from what, reads [`units`].
//!
//! Two things beside keys decide what is made. A unit may hand something on that the next one uses
//! up (photons that wait to be sorted): it is current as long as that is there or the next one is.
//! And a unit of long work leaves drafts when it is interrupted, which the next run goes on with;
//! the manifest says which key they were begun with, so that they are never taken for another's.

use std::path::PathBuf;

use glintmap_formats::seal;

use super::error::Error;
use super::stage::Stage;
use crate::project::keys::Keys;
use crate::project::{
    Candidate, Folder, PhotonGather, Picture, PlannedView, Points, Resolved, SeriesOf, Target,
};

/// What makes a unit, with what it is made for.
#[derive(Clone, Copy, Debug)]
pub enum Work<'a> {
    /// The timesteps.
    Suns,
    /// Photons of a candidate, unsorted.
    Trace(&'a Candidate),
    /// Its photon store.
    Pages(&'a Candidate),
    /// What the pixels of a picture see.
    Hits(&'a PlannedView, &'a Picture),
    /// The daylight background.
    Background(&'a PlannedView, &'a Picture),
    /// Where points lie, and what they see.
    Place(&'a PlannedView, &'a Points),
    /// Photons that cross discs in free air.
    Air(OfView<'a>, &'a PhotonGather),
    /// Maps of the year, from photons.
    Annual(OfView<'a>, &'a PhotonGather),
    /// The time series from photons, or its analyses where none is kept.
    Series(OfView<'a>, &'a PhotonGather),
    /// Maps of the year and time series by integration.
    Integrate(OfView<'a>),
    /// Durations and events above a threshold, W/m2.
    Glare(OfView<'a>, f64),
    /// What arrives at points.
    Received(OfView<'a>),
    /// What the observers' eyes see.
    Eyes,
    /// Maps in colours, charts.
    Pictures,
    /// Pictures of luminances.
    Moments,
    /// What the rules say.
    Verdicts,
    /// The document.
    Report,
}

/// A candidate in a view, or at a set of points.
#[derive(Clone, Copy, Debug)]
pub struct OfView<'a> {
    /// The material or case.
    pub candidate: &'a Candidate,
    /// The view.
    pub view: &'a PlannedView,
}

/// A unit of work that the plan asks for.
#[derive(Clone, Debug)]
pub struct Unit<'a> {
    /// The stage that makes it.
    pub stage: Stage,
    /// Its name in the manifest.
    pub name: String,
    /// What it must have been made from.
    pub key: String,
    /// What makes it.
    pub work: Work<'a>,
    /// What an interrupted making leaves below `run/`, to be gone on with.
    pub drafts: Vec<PathBuf>,
    /// What another unit uses up.
    pub hands_on: Option<HandedOn>,
}

/// Something that one unit makes and another uses up.
#[derive(Clone, Debug)]
pub struct HandedOn {
    /// Below `run/`.
    pub path: PathBuf,
    /// The name of the unit that uses it up.
    pub to: String,
}

impl Work<'_> {
    fn stage(&self) -> Stage {
        match self {
            Self::Suns => Stage::Suns,
            Self::Trace(_) => Stage::Trace,
            Self::Pages(_) => Stage::Pages,
            Self::Hits(..)
            | Self::Background(..)
            | Self::Place(..)
            | Self::Air(..)
            | Self::Annual(..)
            | Self::Series(..)
            | Self::Integrate(_) => Stage::Render,
            Self::Glare(..) | Self::Received(_) | Self::Eyes => Stage::Glare,
            Self::Pictures | Self::Moments => Stage::Pictures,
            Self::Verdicts | Self::Report => Stage::Report,
        }
    }

    /// The name of the unit. Users read it in the log and in what `run` says.
    pub fn name(&self) -> String {
        match self {
            Self::Suns => "suns".into(),
            Self::Trace(c) => format!("trace {}", c.name),
            Self::Pages(c) => format!("pages {}", c.name),
            Self::Hits(v, _) | Self::Place(v, _) => format!("hits {}", v.name),
            Self::Background(v, _) => format!("direct {}", v.name),
            Self::Air(of, _) => format!("air {of}"),
            Self::Annual(of, _) => format!("annual {of}"),
            Self::Series(of, _) | Self::Integrate(of) => format!("render {of}"),
            Self::Glare(of, threshold) => format!("glare {of} {threshold}"),
            Self::Received(of) => format!("glare {of} points"),
            Self::Eyes => "glare observers".into(),
            Self::Pictures => "pictures".into(),
            Self::Moments => "pictures moments".into(),
            Self::Verdicts => "verdicts".into(),
            Self::Report => "report".into(),
        }
    }

    /// Whether the scene has to be read for it before anything is known to be right.
    pub fn reads_the_scene(&self) -> bool {
        matches!(
            self,
            Self::Trace(_)
                | Self::Pages(_)
                | Self::Hits(..)
                | Self::Background(..)
                | Self::Place(..)
        )
    }

    fn drafts(&self, folder: &Folder) -> Vec<PathBuf> {
        match self {
            Self::Trace(c) => vec![folder.spill(&c.name)],
            Self::Pages(c) => vec![seal::growing(&folder.store(&c.name))],
            Self::Air(OfView { candidate: c, view: v }, _) => {
                let store = folder.air(&c.name, &v.name);
                vec![folder.air_spill(&c.name, &v.name), seal::growing(&store)]
            }
            Self::Series(OfView { candidate: c, view: v }, _)
            | Self::Integrate(OfView { candidate: c, view: v }) => {
                let all = SeriesOf::all();
                let series = all.iter().map(|of| folder.series_of(&c.name, &v.name, *of));
                let notes = all.iter().map(|of| folder.tile_notes(&c.name, &v.name, *of));
                let waiting = folder.waiting_tiles(&c.name, &v.name);
                series.chain(notes).chain([waiting]).collect()
            }
            _ => Vec::new(),
        }
    }
}

impl std::fmt::Display for OfView<'_> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "{} {}", self.candidate.name, self.view.name)
    }
}

/// Units as they are added.
struct Units<'a, 'f> {
    resolved: &'a Resolved,
    folder: &'f Folder,
    keys: Keys<'a>,
    all: Vec<Unit<'a>>,
}

/// Every unit of a plan, in the order in which they are made.
///
/// # Errors
/// When settings can't be hashed.
pub fn units<'a>(resolved: &'a Resolved, folder: &Folder) -> Result<Vec<Unit<'a>>, Error> {
    let keys = Keys::of(resolved)?;
    let mut units = Units { resolved, folder, keys, all: Vec::new() };
    units.add(Work::Suns, units.keys.suns.clone());
    let mut stores = Vec::new();
    for candidate in &resolved.candidates {
        stores.push(if resolved.needs_photons() {
            let photons = units.add(Work::Trace(candidate), units.keys.photons(candidate)?);
            Some(units.add(Work::Pages(candidate), units.keys.pages(&photons)?))
        } else {
            None
        });
    }
    let hits: Vec<String> =
        resolved.with_sensors().map(|view| units.hits(view)).collect::<Result<_, _>>()?;
    for (candidate, store) in resolved.candidates.iter().zip(&stores) {
        for (view, hits) in resolved.with_sensors().zip(&hits) {
            units.of_view(OfView { candidate, view }, store.as_deref(), hits)?;
        }
    }
    if !resolved.project.observer.is_empty() {
        units.add(Work::Eyes, units.keys.eyes()?);
    }
    let drawn = units.keys.pictures(&units.made_by(|work| !matches!(work, Work::Eyes)))?;
    units.add(Work::Pictures, drawn);
    if !resolved.moments.is_empty() {
        units.add(Work::Moments, units.keys.moments()?);
    }
    let read = units.made_by(|work| matches!(work, Work::Received(_) | Work::Eyes));
    let judged = units.keys.verdicts(&read)?;
    units.add(Work::Verdicts, judged);
    let told = units.keys.report(&units.made_by(|_| true))?;
    units.add(Work::Report, told);
    let mut all = units.all;
    all.sort_by_key(|unit| unit.stage);
    Ok(all)
}

impl<'a> Units<'a, '_> {
    /// Adds a unit; its key, for what is made from it.
    fn add(&mut self, work: Work<'a>, key: String) -> String {
        let hands_on = match work {
            Work::Trace(c) => {
                let (path, to) = (self.folder.spill(&c.name), Work::Pages(c).name());
                Some(HandedOn { path, to })
            }
            _ => None,
        };
        let (stage, name, drafts) = (work.stage(), work.name(), work.drafts(self.folder));
        self.all.push(Unit { stage, name, key: key.clone(), work, drafts, hands_on });
        key
    }

    /// The keys of the units so far that do such work.
    fn made_by(&self, such: impl Fn(&Work<'_>) -> bool) -> Vec<&str> {
        self.all.iter().filter(|u| such(&u.work)).map(|u| u.key.as_str()).collect()
    }

    /// What a view sees; its background.
    fn hits(&mut self, view: &'a PlannedView) -> Result<String, Error> {
        match &view.target {
            Target::Picture(picture) => {
                let key = self.keys.hits(view, &[])?;
                let hits = self.add(Work::Hits(view, picture), key);
                let key = self.keys.background(&hits)?;
                self.add(Work::Background(view, picture), key);
                Ok(hits)
            }
            Target::Points(points) => {
                // Polygons that are drawn in pictures mean what the pictures see.
                let regions = &self.resolved.project.region;
                let drawn = |v: &PlannedView| {
                    matches!(points, Points::Receivers)
                        && regions.iter().any(|r| r.view.as_ref() == Some(&v.name))
                };
                let seen = self.made_by(|work| matches!(work, Work::Hits(v, _) if drawn(v)));
                let key = self.keys.hits(view, &seen)?;
                Ok(self.add(Work::Place(view, points), key))
            }
        }
    }

    /// What is made of a candidate in a view. `store`: the key of its photons, where there are any.
    fn of_view(&mut self, of: OfView<'a>, store: Option<&str>, hits: &str) -> Result<(), Error> {
        let OfView { candidate, view } = of;
        let mut made_from = vec![hits.to_owned()];
        let mut annual = None;
        let work = match (view.photons(), store) {
            (Some(gather), Some(store)) => {
                made_from.push(store.to_owned());
                if view.points().is_some() {
                    let key = self.keys.air(store, hits, gather)?;
                    made_from.push(self.add(Work::Air(of, gather), key));
                }
                let key = self.keys.annual(candidate, view, gather, &made_from)?;
                annual = Some(self.add(Work::Annual(of, gather), key));
                Work::Series(of, gather)
            }
            _ => Work::Integrate(of),
        };
        let key = self.keys.render(candidate, view, &made_from)?;
        let rendered = self.add(work, key);
        // Where there are photons, they tell which PV surface sends what is seen.
        let mut made_from: Vec<String> = store.map(str::to_owned).into_iter().collect();
        made_from.push(rendered);
        let mut read_off: Vec<String> = annual.into_iter().collect();
        for &threshold in &self.resolved.project.glare.thresholds_w_m2 {
            let key = self.keys.glare(threshold, &made_from)?;
            read_off.push(self.add(Work::Glare(of, threshold), key));
        }
        if view.points().is_some() {
            let key = self.keys.received(&[made_from, read_off].concat())?;
            self.add(Work::Received(of), key);
        }
        Ok(())
    }
}
