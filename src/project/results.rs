//! What a run has made so far, for those who only read it: receivers and the report.

use super::artifacts::RECEIVERS;
use super::folder::Folder;
use super::resolve::Resolved;
use super::views::PlannedView;
use crate::base::Timeline;
use crate::rules::Class;

/// A plan, its timesteps, and the folder in which its results lie.
#[derive(Clone, Copy)]
pub struct Results<'a> {
    /// Where they lie.
    pub folder: &'a Folder,
    /// What they were made from.
    pub resolved: &'a Resolved,
    /// The timesteps.
    pub timeline: &'a Timeline,
}

impl<'a> Results<'a> {
    /// The set of the points of observers and regions; none where the project names neither.
    pub fn receivers(&self) -> Option<&'a PlannedView> {
        self.resolved.sensors.iter().find(|s| s.name == RECEIVERS)
    }

    /// The class that the project file gives an observer or region.
    pub fn class(&self, name: &str) -> Option<Class> {
        let p = &self.resolved.project;
        let observer = p.observer.iter().find(|o| o.name == name).map(|o| o.class);
        let region = p.region.iter().find(|r| r.name == name).map(|r| r.class);
        observer.or(region).flatten()
    }

    /// The thresholds of the project, W/m2.
    pub fn thresholds_w_m2(&self) -> &'a [f64] {
        &self.resolved.project.glare.thresholds_w_m2
    }
}
