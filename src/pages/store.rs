//! The sealed store: opened, checked, gone through.
//!
//! The problem: photons by the billion, more than memory holds, of which every pixel of every view asks
//! for some hundreds around a point.
//!
//! The idea: Radiance's out-of-core photon map (Schregle 2016, "A practical introduction to
//! out-of-core photon mapping", with its leaf file in Morton order and its page cache), thought
//! again for light that changes over a year. Photons lie in the order of their Morton codes, in pages of at most 8,192 that
//! are compressed column by column, so that a page is a compact piece of space and neighbouring pixels
//! ask for the same pages. Above them is an octree, small enough for memory. A page that is looked into
//! becomes columns of floats in blocks of 128 with a box each, which a search goes through without a branch.
//! For questions about some timesteps a page knows its first and last one, from when it was read.
//!
//! A number in the file is a claim. Opening bounds every count by the file's length and by the limits,
//! and holds nodes and pages against each other; reading a page holds its checksum, box, timesteps and surfaces
//! against the directory. So a search walks without checks, ends, and misses nothing.
//!
//! What lost: a k-d tree over single photons (a cache miss at each of 25 levels, and no order on disk), 32-bit
//! photon numbers, and positions as floats (12 bytes instead of the 3 to 4 that codes within a page take).

use std::cell::RefCell;
use std::fs::File;
use std::io::{self, BufReader};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::Vec3;
use glintmap_formats::checksum::crc32c;
use glintmap_formats::gmp::{self, Node, PageEntry};
use glintmap_formats::header;
use rayon::prelude::*;

use super::Error;
use super::cache::{Cache, CacheStats};
use super::mapped::{Access, Bytes};
use super::page::{BLOCK, Light, Page};
use super::query::ALWAYS;
use super::store_header::{Header, StoreInfo, max_radius_m};
use super::tree::{node_box, page_box};
use crate::base::{Aabb, Photon, limits};

/// The timesteps of a page that wasn't read yet.
const ANY_STEP: u64 = u32::MAX as u64;

/// How to open a store.
#[derive(Clone, Copy, Debug)]
pub struct OpenOptions {
    /// What decompressed pages may take in memory, bytes.
    pub cache_bytes: u64,
    /// How the file is read.
    pub access: Access,
}

/// A sealed photon store. Answers depend on the file alone, never on cache or threads.
pub struct Store {
    path: PathBuf,
    pub(super) header: Header,
    info: StoreInfo,
    bytes: Bytes,
    head: u64,
    pub(super) nodes: Vec<Node>,
    pub(super) pages: Vec<PageEntry>,
    cache: Cache,
    /// First and last timestep of each page that was read so far, in two halves; of others any.
    steps: Vec<AtomicU64>,
}

/// Whether two boxes have no point in common.
fn apart(a: Aabb, b: Aabb) -> bool {
    a.min.cmpgt(b.max).any() || a.max.cmplt(b.min).any()
}

impl Store {
    /// Opens a store: reads header and directory, and checks that everything they say is
    /// possible.
    ///
    /// # Errors
    /// [`Error::Header`], [`Error::Damaged`] with the byte, or what the file system says.
    pub fn open(path: &Path, options: &OpenOptions) -> Result<Self, Error> {
        let file = File::open(path).map_err(Error::io(path, "opening"))?;
        let (header, head): (Header, usize) =
            header::read(&mut BufReader::new(&file), gmp::NAME, gmp::VERSION)
                .map_err(|source| Error::Header { path: path.to_owned(), source })?;
        let head = head as u64;
        let layout = header.layout;
        let length = file.metadata().map_err(Error::io(path, "asking its length"))?.len();
        let damaged = |byte, part: &str, what: String| Error::Damaged {
            path: path.to_owned(),
            byte,
            part: part.to_owned(),
            what,
            stage: "pages",
        };
        let expected = head
            .checked_add(layout.pages_bytes)
            .and_then(|n| n.checked_add(layout.directory_bytes));
        if expected != Some(length) {
            let expected = expected.map_or("more than 2^64".to_owned(), |n| n.to_string());
            return Err(damaged(
                length,
                "end of file",
                format!("{expected} bytes expected, found {length}"),
            ));
        }
        check_header(&header).map_err(|what| damaged(0, "header", what))?;

        let bytes = Bytes::new(file, options.access).map_err(Error::io(path, "mapping"))?;
        let at = head + layout.pages_bytes;
        let directory = bytes
            .range(at, layout.directory_bytes as usize)
            .map_err(Error::io(path, "reading the directory"))?;
        let sum = crc32c(&directory);
        if sum != layout.directory_crc32c {
            let what =
                format!("checksum {:08x} expected, found {sum:08x}", layout.directory_crc32c);
            return Err(damaged(at, "directory", what));
        }
        let (nodes, pages) = gmp::decode_directory(&directory, layout.nodes, layout.pages)
            .map_err(|e| damaged(at, "directory", e.to_string()))?;
        drop(directory);
        check_pages(&pages, &header).map_err(|(i, what)| {
            let byte = at + (nodes.len() * gmp::NODE_BYTES + i * gmp::ENTRY_BYTES) as u64;
            damaged(byte, &format!("directory, page {i}"), what)
        })?;
        check_nodes(&nodes, &pages).map_err(|(i, what)| {
            damaged(at + (i * gmp::NODE_BYTES) as u64, &format!("directory, node {i}"), what)
        })?;
        let cache = Cache::new(options.cache_bytes, pages.len());
        Ok(Self {
            path: path.to_owned(),
            info: header.info(),
            header,
            bytes,
            head,
            steps: pages.iter().map(|_| AtomicU64::new(ANY_STEP)).collect(),
            nodes,
            pages,
            cache,
        })
    }

    /// What the header says.
    pub fn info(&self) -> &StoreInfo {
        &self.info
    }

    /// How far a search for `bandwidth` photons goes at most, metres:
    /// [`RADIUS_RULE`](super::RADIUS_RULE).
    pub fn max_radius_m(&self, bandwidth: usize) -> f32 {
        max_radius_m(self.info.area_m2_per_photon, bandwidth)
    }

    /// What the cache did so far.
    pub fn cache_stats(&self) -> CacheStats {
        self.cache.stats()
    }

    /// Calls `each` with index and photon for all photons in `region` (borders included), in
    /// store order.
    ///
    /// # Errors
    /// [`Error::Damaged`] where a page doesn't hold what it promises.
    pub fn in_box(&self, region: Aabb, mut each: impl FnMut(u64, &Photon)) -> Result<(), Error> {
        self.pages_in_box(region, &ALWAYS, |first, page| {
            for (block, _) in page.blocks.iter().enumerate().filter(|(_, b)| !apart(**b, region)) {
                for i in page.block(block).filter(|&i| region.contains(page.position(i))) {
                    each(first + i as u64, &page.photon(i));
                }
            }
            true
        })
    }

    /// Calls `each` with the pages that touch `region` and may hold `timesteps`, and the index of
    /// their first photon, in store order, until it says false.
    fn pages_in_box(
        &self,
        region: Aabb,
        timesteps: &Range<u32>,
        mut each: impl FnMut(u64, &Page) -> bool,
    ) -> Result<(), Error> {
        let mut stack = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(number) = stack.pop() {
            let node = &self.nodes[number];
            if apart(node_box(node), region) {
                continue;
            }
            let first = node.first_child as usize;
            stack.extend((first..first + node.children as usize).rev());
            if node.children > 0 {
                continue;
            }
            let first = node.first_page as usize;
            for number in first..first + node.pages as usize {
                let out = apart(page_box(&self.pages[number]), region);
                if out || !self.may_hold(number, timesteps) {
                    continue;
                }
                let page = self.page(number)?;
                if !each(self.pages[number].first_photon, &page) {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Calls `each` with index, position, normal and light of the photons of some timesteps in
    /// `region` (borders included), in store order, until it says false: several times faster than
    /// whole photons. Few timesteps cost their own photons, not all in the region, and pages without
    /// any such photon are passed over once they are known, without being decoded again.
    ///
    /// # Errors
    /// [`Error::Damaged`] where a page doesn't hold what it promises.
    pub fn lit_in_box(
        &self,
        region: Aabb,
        timesteps: &Range<u32>,
        mut each: impl FnMut(u64, Vec3, Vec3, &Light) -> bool,
    ) -> Result<(), Error> {
        let mut few = Vec::new();
        self.pages_in_box(region, timesteps, |first, page| {
            let mut look = |i: usize| {
                let place = page.position(i);
                let normal = page.normals[usize::from(page.normal[i])];
                !region.contains(place) || each(first + i as u64, place, normal, &page.light[i])
            };
            let (first_step, last_step) = page.timesteps();
            if first_step < timesteps.start || last_step >= timesteps.end {
                page.of_timesteps(timesteps, &mut few);
                return few.iter().all(|&i| look(usize::from(i)));
            }
            page.blocks
                .iter()
                .enumerate()
                .all(|(block, &bounds)| apart(bounds, region) || page.block(block).all(&mut look))
        })
    }

    /// How many photons lie in `region`, roughly: those of a block are taken for evenly spread
    /// over its box. Stops counting somewhere above `most`.
    ///
    /// # Errors
    /// [`Error::Damaged`] where a page doesn't hold what it promises.
    pub fn about_in_box(&self, region: Aabb, most: f32) -> Result<f32, Error> {
        let mut sum = 0.0;
        self.pages_in_box(region, &ALWAYS, |_, page| {
            for &bounds in &page.blocks {
                if apart(bounds, region) {
                    continue;
                }
                let overlap = bounds.max.min(region.max) - bounds.min.max(region.min);
                let share = (overlap.max(Vec3::ZERO) + 1e-6) / (bounds.size() + 1e-6);
                sum += BLOCK as f32 * share.x * share.y * share.z;
            }
            sum <= most
        })?;
        Ok(sum)
    }

    /// Calls `each` with index and photon for all photons in store order. Goes past the cache.
    ///
    /// # Errors
    /// [`Error::Damaged`] where a page doesn't hold what it promises.
    pub fn scan(&self, mut each: impl FnMut(u64, &Photon)) -> Result<(), Error> {
        let together = 4 * rayon::current_num_threads();
        for start in (0..self.pages.len()).step_by(together) {
            let range = start..self.pages.len().min(start + together);
            let pages: Vec<Page> =
                range.clone().into_par_iter().map(|n| self.read(n)).collect::<Result<_, _>>()?;
            for (number, page) in range.zip(&pages) {
                for i in 0..page.photons {
                    each(self.pages[number].first_photon + i as u64, &page.photon(i));
                }
            }
        }
        Ok(())
    }

    /// Whether a page may hold photons of some timesteps: true until it was read once.
    fn may_hold(&self, number: usize, timesteps: &Range<u32>) -> bool {
        let steps = self.steps[number].load(Ordering::Relaxed);
        let (first, last) = ((steps >> 32) as u32, steps as u32);
        first < timesteps.end && last >= timesteps.start
    }

    /// A page, from the cache or the file.
    pub(super) fn page(&self, number: usize) -> Result<Arc<Page>, Error> {
        self.cache.get(number, || self.read(number))
    }

    /// Reads and checks a page.
    pub(super) fn read(&self, number: usize) -> Result<Page, Error> {
        thread_local! {
            // A decoder is a buffer and zstd's context: kept for each thread, because fresh
            // memory costs more than decompression.
            static DECODER: RefCell<Option<gmp::Decoder>> = const { RefCell::new(None) };
        }
        let entry = &self.pages[number];
        let bytes = self.bytes.range(self.head + entry.offset, entry.length as usize);
        let bytes = match bytes {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => {
                return Err(self.damaged(number, "the file ends inside it".to_owned()));
            }
            Err(e) => return Err(Error::io(&self.path, format!("reading page {number}"))(e)),
        };
        let columns = DECODER.with_borrow_mut(|decoder| {
            let decoder = match decoder {
                Some(decoder) => decoder,
                None => decoder.insert(gmp::Decoder::new()?),
            };
            decoder.page(&bytes)
        });
        let columns = columns.map_err(|e| self.damaged(number, e.to_string()))?;
        // The decoder held the content against the page's own checksum.
        if bytes[..4] != entry.checksum.to_le_bytes() {
            let what = format!("field `checksum`: the directory has {:08x}", entry.checksum);
            return Err(self.damaged(number, what));
        }
        self.bytes.release(self.head + entry.offset, entry.length as usize);
        let page = Page::new(&columns);
        if page.photons != entry.photons as usize {
            let what = format!("{} photons, the directory has {}", page.photons, entry.photons);
            return Err(self.damaged(number, what));
        }
        if page.bounds() != page_box(entry) {
            let what = format!(
                "its photons fill {:?}, the directory has {:?}",
                page.bounds(),
                page_box(entry)
            );
            return Err(self.damaged(number, what));
        }
        for light in &page.light {
            let known = light.timestep < self.header.timesteps
                && usize::from(light.surface) < self.header.surfaces.len();
            if !known {
                let what = format!(
                    "a photon of timestep {} and PV surface {}, the header has {} and {}",
                    light.timestep,
                    light.surface,
                    self.header.timesteps,
                    self.header.surfaces.len()
                );
                return Err(self.damaged(number, what));
            }
        }
        let (first, last) = page.timesteps();
        self.steps[number].store(u64::from(first) << 32 | u64::from(last), Ordering::Relaxed);
        Ok(page)
    }

    fn damaged(&self, number: usize, what: String) -> Error {
        Error::Damaged {
            path: self.path.clone(),
            byte: self.head + self.pages[number].offset,
            part: format!("page {number} of {}", self.pages.len()),
            what,
            stage: "pages",
        }
    }
}

fn check_header(header: &Header) -> Result<(), String> {
    let layout = &header.layout;
    if header.photons > limits::MAX_PHOTONS {
        return Err(format!("{} photons, at most {}", header.photons, limits::MAX_PHOTONS));
    }
    if header.timesteps as usize > limits::MAX_TIMESTEPS {
        return Err(format!("{} timesteps, at most {}", header.timesteps, limits::MAX_TIMESTEPS));
    }
    if header.surfaces.len() > limits::MAX_PV_SURFACES {
        return Err(format!("{} PV surfaces", header.surfaces.len()));
    }
    if layout.page_photons == 0 || layout.page_photons as usize > gmp::PAGE_PHOTONS_MAX {
        return Err(format!("pages of {} photons", layout.page_photons));
    }
    if !layout.cube.is_sound() {
        return Err(format!("cube {:?}", layout.cube));
    }
    let area = header.search.area_m2_per_photon;
    if !(area.is_finite() && area >= 0.0) {
        return Err(format!("area_m2_per_photon {area}"));
    }
    Ok(())
}

fn check_pages(pages: &[PageEntry], header: &Header) -> Result<(), (usize, String)> {
    let (mut offset, mut photons, mut cell) = (0u64, 0u64, 0u64);
    for (i, page) in pages.iter().enumerate() {
        let wrong = |what: String| Err((i, what));
        if page.offset != offset || page.first_photon != photons {
            return wrong(format!(
                "offset {} and first photon {}, expected {offset} and {photons}",
                page.offset, page.first_photon
            ));
        }
        if page.photons == 0 || page.photons > header.layout.page_photons {
            return wrong(format!(
                "{} photons, at most {}",
                page.photons, header.layout.page_photons
            ));
        }
        // Strictly behind the page before, unless both are one chain in one cell.
        let chained = i > 0
            && pages[i - 1].first_cell == page.first_cell
            && page.first_cell == page.last_cell;
        if page.first_cell < cell && !chained
            || page.first_cell > page.last_cell
            || page.last_cell >> 63 != 0
        {
            return wrong(format!(
                "cells {:x} to {:x} out of order",
                page.first_cell, page.last_cell
            ));
        }
        let bounds = page_box(page);
        if !bounds.min.is_finite() || !bounds.max.is_finite() || bounds.is_empty() {
            return wrong(format!("box {bounds:?}"));
        }
        if page.reserved != 0 {
            return wrong(format!("reserved is {}", page.reserved));
        }
        // Bounded by the file's length: the sums are compared below.
        offset = offset.saturating_add(u64::from(page.length));
        photons += u64::from(page.photons);
        cell = page.last_cell + 1;
    }
    if offset != header.layout.pages_bytes || photons != header.photons {
        let what = format!(
            "all pages: {offset} bytes and {photons} photons, the header has {} and {}",
            header.layout.pages_bytes, header.photons
        );
        return Err((pages.len(), what));
    }
    Ok(())
}

/// Every node but the root is the child of one node before it, children part their parent's
/// pages, boxes hold what is below: a walk from the root ends, and misses nothing.
fn check_nodes(nodes: &[Node], pages: &[PageEntry]) -> Result<(), (usize, String)> {
    if nodes.is_empty() != pages.is_empty() {
        return Err((0, format!("{} nodes for {} pages", nodes.len(), pages.len())));
    }
    let mut next_child = 1u64;
    for (i, node) in nodes.iter().enumerate() {
        let wrong = |what: String| Err((i, what));
        let end = u64::from(node.first_page) + u64::from(node.pages);
        if node.pages == 0 || end > pages.len() as u64 {
            return wrong(format!("pages {} to {end} of {}", node.first_page, pages.len()));
        }
        if i == 0 && (node.first_page, u64::from(node.pages)) != (0, pages.len() as u64) {
            return wrong("the root doesn't cover all pages".to_owned());
        }
        let below = if node.children == 0 {
            if node.first_child != 0 {
                return wrong("a leaf with a first child".to_owned());
            }
            let range = node.first_page as usize..end as usize;
            pages[range].iter().fold(Aabb::EMPTY, |all, page| all.union(page_box(page)))
        } else {
            let first = u64::from(node.first_child);
            let last = first + u64::from(node.children);
            if first != next_child || first <= i as u64 || last > nodes.len() as u64 {
                return wrong(format!("children {first} to {last} of {}", nodes.len()));
            }
            next_child = last;
            let children = &nodes[first as usize..last as usize];
            let mut page = u64::from(node.first_page);
            for child in children {
                if u64::from(child.first_page) != page {
                    return wrong("its children don't part its pages".to_owned());
                }
                page += u64::from(child.pages);
            }
            if page != end {
                return wrong("its children don't part its pages".to_owned());
            }
            children.iter().fold(Aabb::EMPTY, |all, child| all.union(node_box(child)))
        };
        if below != node_box(node) {
            return wrong(format!("box {:?}, below are {below:?}", node_box(node)));
        }
    }
    if next_child != nodes.len().max(1) as u64 {
        return Err((next_child as usize, "a node without a parent".to_owned()));
    }
    Ok(())
}
