//! Figures about a store, for people.

use super::Error;
use super::bucket::RECORD_BYTES;
use super::store::Store;
use crate::base::Photon;

/// The leaves of one level of the octree.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct LevelStats {
    /// Depth; 0 is the cube.
    pub level: u32,
    /// Nodes with children.
    pub inner_nodes: u64,
    /// Nodes with pages.
    pub leaves: u64,
    /// Their pages.
    pub pages: u64,
    /// The photons in them.
    pub photons: u64,
    /// Bytes of the pages.
    pub bytes: u64,
    /// Photons divided by what the pages could hold.
    pub fill: f64,
}

/// The photons of one timestep.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct PerTimestep {
    /// Number of photons.
    pub photons: u64,
    /// Their flux, W.
    pub flux_w: f64,
}

impl Store {
    /// Bytes of a photon before it is quantised and compressed.
    pub fn raw_photon_bytes(&self) -> usize {
        RECORD_BYTES
    }

    /// The tree, level by level.
    pub fn levels(&self) -> Vec<LevelStats> {
        let mut levels: Vec<LevelStats> = Vec::new();
        for node in &self.nodes {
            let at = node.level as usize;
            while levels.len() <= at {
                levels.push(LevelStats { level: levels.len() as u32, ..LevelStats::default() });
            }
            let level = &mut levels[at];
            if node.children > 0 {
                level.inner_nodes += 1;
                continue;
            }
            level.leaves += 1;
            let first = node.first_page as usize;
            for page in &self.pages[first..first + node.pages as usize] {
                level.pages += 1;
                level.photons += u64::from(page.photons);
                level.bytes += u64::from(page.length);
            }
            let room = level.pages * u64::from(self.facts.layout.page_photons);
            level.fill = level.photons as f64 / room as f64;
        }
        levels
    }

    /// Calls `each` with index and photon for the photons of a page, in store order; for none
    /// where there is no such page. Goes past the cache.
    ///
    /// # Errors
    /// [`Error::Damaged`] where the page doesn't hold what it promises.
    pub fn in_page(&self, number: usize, mut each: impl FnMut(u64, &Photon)) -> Result<(), Error> {
        let Some(entry) = self.pages.get(number) else { return Ok(()) };
        let page = self.read(number)?;
        for i in 0..page.photons {
            each(entry.first_photon + i as u64, &page.photon(i));
        }
        Ok(())
    }

    /// Counts and flux of all timesteps, also of those without photons.
    ///
    /// # Errors
    /// [`Error::Damaged`] where a page doesn't hold what it promises.
    pub fn per_timestep(&self) -> Result<Vec<PerTimestep>, Error> {
        let mut out = vec![PerTimestep::default(); self.facts.timesteps as usize];
        self.scan(|_, photon| {
            // Reading a page checked the timestep.
            let step = &mut out[photon.timestep as usize];
            step.photons += 1;
            step.flux_w += f64::from(photon.flux_w);
        })?;
        Ok(out)
    }
}
