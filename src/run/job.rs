//! What a run works on: the stages, how to run them, what was done, and what they all need.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::disk::{lies_inside, remove};
use super::error::Error;
use super::log::Log;
use super::stage::{Options, Stage};
use super::units::{HandedOn, Unit, units};
use crate::base::{Finding, Progress, Provenance, Severity, Timeline};
use crate::pages::CacheStats;
use crate::project::{Folder, Manifest, Resolved};
use crate::render::PvSight;
use crate::report::Judgement;
use crate::site::Site;

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
    /// All units, in their order.
    pub plan: Vec<Unit<'a>>,
    pub manifest: Manifest,
    pub summary: Summary,
    pub progress: &'a dyn Progress,
    pub log: Log,
    site: OnceLock<Site>,
    timeline: OnceLock<Timeline>,
    sight: OnceLock<PvSight>,
}

/// What the making of a unit gave.
#[derive(Debug, Default)]
pub(super) struct Made {
    /// Files and folders below `run/`.
    pub outputs: Vec<PathBuf>,
    /// For the log.
    pub facts: Value,
    /// For people.
    pub warnings: Vec<String>,
    /// Units that came about on the way.
    pub others: Vec<MadeToo>,
}

/// A unit that came about while another was made.
#[derive(Debug)]
pub(super) struct MadeToo {
    pub name: String,
    pub key: String,
    pub made: Made,
}

impl Made {
    pub fn new(outputs: Vec<PathBuf>, facts: Value) -> Self {
        Self { outputs, facts, ..Self::default() }
    }
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
            plan: units(resolved, &folder)?,
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
            sight: OnceLock::new(),
        })
    }

    /// The units up to `--until`.
    pub fn planned(&self) -> impl Iterator<Item = &Unit<'a>> + '_ {
        self.plan.iter().filter(|unit| unit.stage <= self.options.until)
    }
}

impl Job<'_> {
    pub fn is_forced(&self, stage: Stage) -> bool {
        self.options.force.is_some_and(|f| stage >= f)
    }

    /// Whether a unit needn't be made: it was made in this run, or from the same settings by an
    /// earlier one, all that it left is there, and it isn't forced. The only place that decides it.
    pub fn is_current(&self, unit: &Unit<'_>) -> bool {
        if self.summary.made.contains(&unit.name) {
            return true;
        }
        let used_up = |on: &HandedOn| {
            let next = self.plan.iter().find(|next| next.name == on.to);
            self.folder.at(&on.path).exists() || next.is_some_and(|next| self.is_current(next))
        };
        !self.is_forced(unit.stage)
            && self.manifest.is_current(self.folder.root(), &unit.name, &unit.key)
            && unit.hands_on.as_ref().is_none_or(used_up)
    }

    pub fn has_to_read_the_scene(&self) -> bool {
        self.planned().any(|unit| unit.work.reads_the_scene() && !self.is_current(unit))
    }

    /// Before a stage begins: what was made from other settings, or is to be made anew, goes. So
    /// the manifest never calls something current that is being overwritten, and no later stage
    /// finds results that belong to something else. Where a unit only misses a file, the others
    /// stay.
    pub fn forget(&mut self, stage: Stage) -> Result<(), Error> {
        let stale: Vec<&Unit<'_>> =
            self.planned().filter(|u| u.stage == stage && !self.is_current(u)).collect();
        let stale: Vec<(String, String)> =
            stale.into_iter().map(|u| (u.name.clone(), u.key.clone())).collect();
        let mut forgotten = false;
        let mut gone = Vec::new();
        for (name, key) in stale {
            let Some(done) = self.manifest.units.remove(&name) else { continue };
            forgotten = true;
            if self.is_forced(stage) || key != done.key {
                gone.extend(done.outputs.into_keys());
            }
        }
        if !forgotten {
            return Ok(());
        }
        self.manifest.write(self.folder.root())?;
        for name in gone.iter().map(Path::new).filter(|n| lies_inside(n)) {
            self.remove(name)?;
        }
        Ok(())
    }

    /// Before a unit is made: drafts that were begun with other settings, or are to be made anew,
    /// go. The rest is gone on with.
    pub fn begin(&mut self, unit: &Unit<'_>) -> Result<(), Error> {
        let goes_on = self.manifest.begun.get(&unit.name) == Some(&unit.key);
        if unit.drafts.is_empty() || goes_on && !self.is_forced(unit.stage) {
            return Ok(());
        }
        for draft in &unit.drafts {
            self.remove(draft)?;
        }
        self.manifest.begun.insert(unit.name.clone(), unit.key.clone());
        Ok(self.manifest.write(self.folder.root())?)
    }

    /// Notes that a unit was made.
    pub fn done(&mut self, name: &str, key: &str, made: Made, began: Instant) -> Result<(), Error> {
        for MadeToo { name, key, made } in made.others {
            self.done(&name, &key, made, began)?;
        }
        made.warnings.into_iter().for_each(|warning| self.warn(warning));
        self.manifest.record(self.folder.root(), name, key, &made.outputs)?;
        self.note(name, began, made.facts)
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

    /// What the PV sees of the suns; computed when first asked for.
    pub fn sight(&self) -> Result<&PvSight, Error> {
        if let Some(sight) = self.sight.get() {
            return Ok(sight);
        }
        let free = self.resolved.trace.sun_visibility;
        let sight = PvSight::new(self.site()?, self.timeline()?, free, self.progress)?;
        Ok(self.sight.get_or_init(|| sight))
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

    /// After a unit was made or found current: drafts that are no outputs go, and what it used up.
    /// A run that was stopped before they could go leaves them to the next one.
    pub fn settle(&mut self, unit: &Unit<'_>) -> Result<(), Error> {
        let done = self.manifest.units.get(&unit.name);
        let kept = |draft: &PathBuf| {
            let name = draft.to_string_lossy().replace('\\', "/");
            done.is_some_and(|d| d.outputs.contains_key(&name))
                || unit.hands_on.as_ref().is_some_and(|on| on.path == *draft)
        };
        let used_up = self.plan.iter().filter_map(|u| u.hands_on.as_ref());
        let used_up = used_up.filter(|on| on.to == unit.name).map(|on| &on.path);
        for path in unit.drafts.iter().filter(|draft| !kept(draft)).chain(used_up) {
            self.remove(path)?;
        }
        if !self.summary.made.contains(&unit.name) {
            self.summary.current.push(unit.name.clone());
        }
        Ok(())
    }

    /// What only one stage needs goes.
    pub fn end_of_stage(&mut self) {
        self.sight.take();
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
    pub fn remove(&self, name: &Path) -> Result<(), Error> {
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
