//! What a run works on: the stages, how to run them, what was done, and what they all need.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::OnceLock;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::clean::{lies_inside, remove};
use super::error::Error;
use super::log::Log;
use super::units::{Planned, units};
use crate::base::{Finding, Progress, Provenance, Severity, Timeline};
use crate::pages::CacheStats;
use crate::project::Folder;
use crate::project::Manifest;
use crate::project::Resolved;
use crate::project::Shard;
use crate::report::Judgement;
use crate::site::Site;

/// The stages of a run, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// The timesteps and their suns.
    Suns,
    /// Photons from the PV onto the scene.
    Trace,
    /// The photon store.
    Pages,
    /// Hits, annual maps, time series.
    Render,
    /// Glare durations and events.
    Glare,
    /// What people look at.
    Pictures,
    /// The document.
    Report,
}

impl Stage {
    /// All stages, in their order.
    pub const ALL: [Self; 7] = [
        Self::Suns,
        Self::Trace,
        Self::Pages,
        Self::Render,
        Self::Glare,
        Self::Pictures,
        Self::Report,
    ];

    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Suns => "suns",
            Self::Trace => "trace",
            Self::Pages => "pages",
            Self::Render => "render",
            Self::Glare => "glare",
            Self::Pictures => "pictures",
            Self::Report => "report",
        }
    }
}

/// How to run.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// The last stage to run.
    pub until: Stage,
    /// Redo this stage and what follows.
    pub force: Option<Stage>,
    /// Only this share of the photons: nothing but the stage `trace` is run.
    pub shard: Option<Shard>,
    /// Bound of anonymous memory, bytes.
    pub memory_bytes: u64,
    /// Of the photon store's page cache, bytes.
    pub page_cache_bytes: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            until: Stage::Report,
            force: None,
            shard: None,
            memory_bytes: 1 << 30,
            page_cache_bytes: 256 << 20,
        }
    }
}

/// What a run did.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// Units that were made now.
    pub made: Vec<String>,
    /// Units that were up to date.
    pub current: Vec<String>,
    /// What the user should know: warnings of the site, the noise, the draft.
    pub warnings: Vec<String>,
    /// What the caches of photon pages did, all together.
    pub page_cache: CacheStats,
    /// Where the results lie.
    pub folder: PathBuf,
    /// Whether verdicts and pictures are a draft.
    pub draft: bool,
    /// What the rules say of observers and regions, once there is a report.
    pub verdicts: Vec<Judgement>,
}

/// Everything that a stage needs; what is costly to make is made when first asked for.
pub(super) struct Job<'a> {
    pub resolved: &'a Resolved,
    pub options: Options,
    pub folder: Folder,
    pub manifest: Manifest,
    pub summary: Summary,
    pub progress: &'a dyn Progress,
    pub log: Log,
    site: OnceLock<Site>,
    timeline: OnceLock<Timeline>,
}

impl<'a> Job<'a> {
    /// A job of which nothing is done yet.
    pub fn new(
        resolved: &'a Resolved,
        options: Options,
        folder: Folder,
        log: Log,
        progress: &'a dyn Progress,
    ) -> Result<Self, Error> {
        Ok(Self {
            resolved,
            options,
            manifest: Manifest::read(folder.root())?,
            summary: Summary {
                folder: folder.root().to_owned(),
                draft: resolved.is_draft(),
                ..Summary::default()
            },
            folder,
            progress,
            log,
            site: OnceLock::new(),
            timeline: OnceLock::new(),
        })
    }
}

impl Job<'_> {
    /// The units up to `--until`, each with whether it has to be made.
    pub fn plan(&self) -> Result<Vec<(Planned, bool)>, Error> {
        let stale = |p: &Planned| {
            self.is_forced(p.stage) || !p.is_current(&self.manifest, self.folder.root())
        };
        Ok(units(self.resolved)?
            .into_iter()
            .filter(|p| p.stage <= self.options.until)
            .map(|p| {
                let stale = stale(&p);
                (p, stale)
            })
            .collect())
    }

    pub fn is_forced(&self, stage: Stage) -> bool {
        self.options.force.is_some_and(|f| stage >= f)
    }

    pub fn has_to_read_the_scene(&self) -> Result<bool, Error> {
        let reads = |stage| matches!(stage, Stage::Trace | Stage::Pages);
        Ok(self.plan()?.iter().any(|(p, stale)| {
            *stale
                && (reads(p.stage) || p.unit.starts_with("hits ") || p.unit.starts_with("direct "))
        }))
    }

    /// Before a stage begins: what was made from other settings, or is to be made anew, goes. So
    /// the manifest never calls something current that is being overwritten, and no later stage
    /// finds results that belong to something else. Where a unit only misses a file, the others
    /// stay.
    pub fn forget(&mut self, stage: Stage) -> Result<(), Error> {
        let mut gone = Vec::new();
        for (planned, stale) in self.plan()? {
            if planned.stage != stage || !stale {
                continue;
            }
            let Some(unit) = self.manifest.units.remove(&planned.unit) else { continue };
            if self.is_forced(stage) || planned.key.is_none_or(|key| key != unit.key) {
                gone.extend(unit.outputs.into_keys());
            } else {
                gone.push(String::new());
            }
        }
        if gone.is_empty() {
            return Ok(());
        }
        self.manifest.write(self.folder.root())?;
        for name in gone.iter().map(std::path::Path::new).filter(|n| lies_inside(n)) {
            self.remove(name)?;
        }
        Ok(())
    }

    /// The scene; read when first asked for.
    pub fn site(&self) -> Result<&Site, Error> {
        if let Some(site) = self.site.get() {
            return Ok(site);
        }
        let site = Site::load(&self.resolved.scene, &self.resolved.pv)?;
        for finding in worth_telling(&site.findings) {
            self.progress.say(&finding.to_string());
        }
        Ok(self.site.get_or_init(|| site))
    }

    /// The timesteps; computed when first asked for.
    pub fn timeline(&self) -> Result<&Timeline, Error> {
        if let Some(timeline) = self.timeline.get() {
            return Ok(timeline);
        }
        let timeline = self.resolved.timeline()?;
        Ok(self.timeline.get_or_init(|| timeline))
    }

    /// What a file of ours says of its making.
    pub fn provenance(&self, key: &str, about: &[(&str, &str)]) -> Provenance {
        Provenance {
            program: Provenance::PROGRAM.into(),
            settings: key.into(),
            seed: self.resolved.trace.seed,
            inputs: self.resolved.inputs_of(about),
            about: about
                .iter()
                .map(|(k, v)| ((*k).to_owned(), (*v).to_owned()))
                .collect::<BTreeMap<_, _>>(),
        }
    }

    /// Whether a unit has to be made: it is missing, out of date or forced. A unit that is
    /// current is counted as such.
    pub fn needs(&mut self, stage: Stage, unit: &str, key: &str) -> bool {
        if !self.is_forced(stage) && self.manifest.is_current(self.folder.root(), unit, key) {
            self.summary.current.push(unit.into());
            return false;
        }
        true
    }

    /// Notes that a unit was made; `outputs` are names below `run/`.
    pub fn done(
        &mut self,
        unit: &str,
        key: &str,
        outputs: &[PathBuf],
        began: Instant,
        facts: Value,
    ) -> Result<(), Error> {
        self.manifest.record(self.folder.root(), unit, key, outputs)?;
        self.note(unit, began, facts)
    }

    /// Notes in the log and the summary that a unit was made, not in the manifest.
    pub fn note(&mut self, unit: &str, began: Instant, mut facts: Value) -> Result<(), Error> {
        if let Some(object) = facts.as_object_mut() {
            object.insert("took_s".into(), began.elapsed().as_secs_f64().into());
        }
        // Of what read photons, the log and the summary tell how the cache did.
        if let Some(stats) = facts.get("cache").and_then(|c| CacheStats::deserialize(c).ok()) {
            self.summary.page_cache.add(&stats);
        }
        self.log.note(unit, &facts)?;
        self.summary.made.push(unit.into());
        Ok(())
    }

    /// Tells the user something now and in the summary.
    pub fn warn(&mut self, message: String) {
        self.progress.say(&format!("warning: {message}"));
        self.summary.warnings.push(message);
    }

    /// Removes an output that is about to be made anew.
    pub fn remove(&self, name: &std::path::Path) -> Result<(), Error> {
        remove(&self.folder.at(name))
    }
}

/// The first warnings of a site, and how many more there are.
fn worth_telling(findings: &[Finding]) -> Vec<String> {
    let serious: Vec<&Finding> = findings.iter().filter(|f| f.severity > Severity::Note).collect();
    let shown = 5;
    let mut out: Vec<String> = serious.iter().take(shown).map(|f| f.to_string()).collect();
    if serious.len() > shown {
        out.push(format!("… and {} more; `glintmap check` lists them", serious.len() - shown));
    }
    out
}
