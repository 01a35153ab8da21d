//! What all stages do with files of a run: maps written and read by what they are, and what files
//! say of their making.

use std::path::PathBuf;

use crate::base::Grid;
use crate::picture::exr;
use crate::project::{Map, Results};
use crate::run::error::Error;
use crate::run::job::Job;
use crate::run::units::OfView;

/// What pictures say of their making.
pub(super) type Attributes = Vec<(String, String)>;

impl Job<'_> {
    /// What was made so far, for those who only read it.
    pub(super) fn results(&self) -> Result<Results<'_>, Error> {
        let timeline = self.timeline()?;
        Ok(Results { folder: &self.folder, resolved: self.resolved, timeline })
    }

    /// What pictures say of their making.
    pub(super) fn attributes(
        &self,
        key: &str,
        about: &[(&str, &str)],
    ) -> Result<Attributes, Error> {
        Ok(self.provenance(key, about).attributes(self.timeline()?.basis))
    }

    /// Reads a map.
    pub(super) fn read_map(
        &self,
        OfView { candidate, view }: OfView<'_>,
        map: Map,
    ) -> Result<Grid<f32>, Error> {
        let path = self.folder.at(&self.folder.exr(&candidate.name, &view.name, map));
        Ok(exr::read_channel(&path, &map.channel())?)
    }

    /// Writes the maps that share a file; its name.
    pub(super) fn write_maps(
        &self,
        of: OfView<'_>,
        maps: &[(Map, &Grid<f32>)],
        attributes: &[(String, String)],
    ) -> Result<Vec<PathBuf>, Error> {
        let Some((first, _)) = maps.first() else { return Ok(Vec::new()) };
        let name = self.folder.exr(&of.candidate.name, &of.view.name, *first);
        let named: Vec<(String, &Grid<f32>)> =
            maps.iter().map(|(map, grid)| (map.channel(), *grid)).collect();
        let channels: Vec<(&str, &Grid<f32>)> =
            named.iter().map(|(channel, grid)| (channel.as_str(), *grid)).collect();
        exr::write(&self.folder.prepare(&name)?, &channels, attributes)?;
        Ok(vec![name])
    }
}
