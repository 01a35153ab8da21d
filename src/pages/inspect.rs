//! Figures about a store, for people.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use glintmap_formats::seal;

use super::Error;
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

/// The photons of one timestep, or of one PV surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Share {
    /// Number of photons.
    pub photons: u64,
    /// Their flux, W.
    pub flux_w: f64,
}

impl Store {
    /// Bytes of a photon before it is quantised and compressed: three vectors, flux, timestep and
    /// surface.
    pub fn raw_photon_bytes(&self) -> usize {
        3 * 12 + 4 + 4 + 2
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
            let room = level.pages * u64::from(self.header.layout.page_photons);
            level.fill = level.photons as f64 / room as f64;
        }
        levels
    }

    /// How many pages are filled to below a tenth of what they may hold, to below two tenths, ...;
    /// the last counts the full ones too.
    pub fn fill_histogram(&self) -> [u64; 10] {
        let mut out = [0; 10];
        for page in &self.pages {
            let tenth = 10 * u64::from(page.photons) / u64::from(self.header.layout.page_photons);
            out[tenth.min(9) as usize] += 1;
        }
        out
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
    pub fn per_timestep(&self) -> Result<Vec<Share>, Error> {
        // Reading a page checked the timestep, and the surface.
        self.shares(self.header.timesteps as usize, |photon| photon.timestep as usize)
    }

    /// Counts and flux of all PV surfaces, in the order of [`StoreInfo`](super::StoreInfo).
    ///
    /// # Errors
    /// [`Error::Damaged`] where a page doesn't hold what it promises.
    pub fn per_surface(&self) -> Result<Vec<Share>, Error> {
        self.shares(self.header.surfaces.len(), |photon| usize::from(photon.surface))
    }

    fn shares(&self, count: usize, of: impl Fn(&Photon) -> usize) -> Result<Vec<Share>, Error> {
        let mut out = vec![Share::default(); count];
        self.scan(|_, photon| {
            let share = &mut out[of(photon)];
            share.photons += 1;
            share.flux_w += f64::from(photon.flux_w);
        })?;
        Ok(out)
    }

    /// Writes `count` photons, evenly spaced in store order, as a binary PLY point cloud, which
    /// appears whole or not at all; all photons where there are fewer. How many it holds.
    ///
    /// # Errors
    /// [`Error::Damaged`] where a page doesn't hold what it promises, or what the file system says.
    pub fn write_ply(&self, path: &Path, count: u64) -> Result<u64, Error> {
        let photons = self.header.photons;
        let count = count.min(photons);
        let doing = || Error::io(path, format!("writing {count} photons as PLY"));
        let mut failed = None;
        let write = |out: &mut BufWriter<File>| {
            out.write_all(ply_head(count).as_bytes())?;
            let mut written = 0;
            for number in 0..self.pages.len() {
                let next = |written: u64| {
                    (u128::from(written) * u128::from(photons) / u128::from(count.max(1))) as u64
                };
                let entry = &self.pages[number];
                let end = entry.first_photon + u64::from(entry.photons);
                if written == count || next(written) >= end {
                    continue;
                }
                let page = match self.read(number) {
                    Ok(page) => page,
                    Err(e) => {
                        failed = Some(e);
                        return Err(io::ErrorKind::InvalidData.into());
                    }
                };
                while written < count && next(written) < end {
                    let at = (next(written) - entry.first_photon) as usize;
                    out.write_all(&ply_point(&page.photon(at)))?;
                    written += 1;
                }
            }
            Ok(())
        };
        match seal::write::<io::Error>(path, write) {
            Ok(()) => Ok(count),
            Err(e) => Err(failed.unwrap_or_else(|| doing()(e))),
        }
    }
}

/// The names are those that MeshLab and CloudCompare know, where they know any.
fn ply_head(count: u64) -> String {
    let floats =
        ["x", "y", "z", "nx", "ny", "nz", "flux_w"].map(|n| format!("property float {n}\n"));
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment photons, metres and watts\nelement vertex {count}\n{}\
         property uint timestep\nproperty ushort surface\nend_header\n",
        floats.concat()
    )
}

fn ply_point(photon: &Photon) -> [u8; 34] {
    let mut out = [0; 34];
    let (p, n) = (photon.position, photon.normal);
    for (at, v) in [p.x, p.y, p.z, n.x, n.y, n.z, photon.flux_w].iter().enumerate() {
        out[4 * at..4 * at + 4].copy_from_slice(&v.to_le_bytes());
    }
    out[28..32].copy_from_slice(&photon.timestep.to_le_bytes());
    out[32..].copy_from_slice(&photon.surface.to_le_bytes());
    out
}
