//! Pages that were read lately, weighed in bytes.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::page::Page;

/// A shard holds a dozen pages at least; with less there is one shard.
const SHARD_BYTES: u64 = 4 << 20;
const SHARDS_MAX: u64 = 16;
const NONE: u32 = u32::MAX;

/// What the cache did since the store was opened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct CacheStats {
    /// Pages that were there.
    pub hits: u64,
    /// Pages that had to be read.
    pub misses: u64,
    /// Pages that made room for others.
    pub evictions: u64,
    /// Bytes of pages that were read, decompressed.
    pub decompressed_bytes: u64,
}

impl CacheStats {
    /// Adds what another cache did.
    pub fn add(&mut self, other: &Self) {
        self.hits += other.hits;
        self.misses += other.misses;
        self.evictions += other.evictions;
        self.decompressed_bytes += other.decompressed_bytes;
    }
}

/// Least recently used pages make room. Shards, each with a lock of its own, so that readers
/// don't wait for each other; reading a page happens outside of the locks.
pub(super) struct Cache {
    shards: Vec<Mutex<Shard>>,
    shard_bytes: usize,
}

impl Cache {
    pub fn new(bytes: u64, pages: usize) -> Self {
        let shards = (bytes / SHARD_BYTES).clamp(1, SHARDS_MAX);
        let slots = pages.div_ceil(shards as usize);
        let shard = || Mutex::new(Shard::new(slots));
        Self {
            shards: (0..shards).map(|_| shard()).collect(),
            shard_bytes: usize::try_from(bytes / shards).unwrap_or(usize::MAX),
        }
    }

    /// The page `number`, from `read` if it isn't there.
    pub fn get<E>(
        &self,
        number: usize,
        read: impl FnOnce() -> Result<Page, E>,
    ) -> Result<Arc<Page>, E> {
        let shards = self.shards.len();
        let (shard, slot) = (number % shards, number / shards);
        if let Some(page) = self.lock(shard).hit(slot) {
            return Ok(page);
        }
        let page = Arc::new(read()?);
        self.lock(shard).miss(slot, &page, self.shard_bytes);
        Ok(page)
    }

    pub fn stats(&self) -> CacheStats {
        let mut all = CacheStats::default();
        (0..self.shards.len()).for_each(|shard| all.add(&self.lock(shard).stats));
        all
    }

    fn lock(&self, shard: usize) -> MutexGuard<'_, Shard> {
        // A shard is whole between its methods; a panic elsewhere doesn't spoil it.
        self.shards[shard].lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A doubly linked list through entries, and where each page's entry is.
struct Shard {
    entry_of: Vec<u32>,
    entries: Vec<Entry>,
    free: Vec<u32>,
    newest: u32,
    oldest: u32,
    bytes: usize,
    stats: CacheStats,
}

struct Entry {
    slot: usize,
    page: Option<Arc<Page>>,
    bytes: usize,
    newer: u32,
    older: u32,
}

impl Shard {
    fn new(slots: usize) -> Self {
        Self {
            entry_of: vec![NONE; slots],
            entries: Vec::new(),
            free: Vec::new(),
            newest: NONE,
            oldest: NONE,
            bytes: 0,
            stats: CacheStats::default(),
        }
    }

    /// A page that is there.
    fn hit(&mut self, slot: usize) -> Option<Arc<Page>> {
        let page = self.touch(slot)?;
        self.stats.hits += 1;
        Some(page)
    }

    /// A page that was read.
    fn miss(&mut self, slot: usize, page: &Arc<Page>, budget: usize) {
        let bytes = page.bytes();
        self.stats.misses += 1;
        self.stats.decompressed_bytes += bytes as u64;
        // A page larger than the budget is used and dropped. Another thread may have read it in the
        // meantime.
        if bytes <= budget && self.touch(slot).is_none() {
            self.insert(slot, page, bytes, budget);
        }
    }

    fn touch(&mut self, slot: usize) -> Option<Arc<Page>> {
        let at = self.entry_of[slot];
        if at == NONE {
            return None;
        }
        if at != self.newest {
            self.unlink(at);
            self.link(at);
        }
        self.entries[at as usize].page.clone()
    }

    fn insert(&mut self, slot: usize, page: &Arc<Page>, bytes: usize, budget: usize) {
        while self.bytes + bytes > budget && self.oldest != NONE {
            let at = self.oldest;
            self.unlink(at);
            let entry = &mut self.entries[at as usize];
            entry.page = None;
            self.bytes -= entry.bytes;
            self.entry_of[entry.slot] = NONE;
            self.free.push(at);
            self.stats.evictions += 1;
        }
        let entry = Entry { slot, page: Some(Arc::clone(page)), bytes, newer: NONE, older: NONE };
        let at = match self.free.pop() {
            Some(at) => {
                self.entries[at as usize] = entry;
                at
            }
            None => {
                self.entries.push(entry);
                self.entries.len() as u32 - 1
            }
        };
        self.entry_of[slot] = at;
        self.bytes += bytes;
        self.link(at);
    }

    fn unlink(&mut self, at: u32) {
        let Entry { newer, older, .. } = self.entries[at as usize];
        match newer {
            NONE => self.newest = older,
            _ => self.entries[newer as usize].older = older,
        }
        match older {
            NONE => self.oldest = newer,
            _ => self.entries[older as usize].newer = newer,
        }
    }

    fn link(&mut self, at: u32) {
        let older = self.newest;
        let entry = &mut self.entries[at as usize];
        (entry.newer, entry.older) = (NONE, older);
        match older {
            NONE => self.oldest = at,
            _ => self.entries[older as usize].newer = at,
        }
        self.newest = at;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn page() -> Result<Page, ()> {
        Ok(Page::new(&glintmap_formats::gmp::Columns {
            origin: [0.0; 3],
            step: 1.0,
            position: vec![1, 2, 3],
            normal_table: vec![[0, 0]],
            normal: vec![0; 3],
            direction: vec![[0, 0]; 3],
            flux: glintmap_formats::gmp::Flux::Equal(0),
            timestep: vec![4; 3],
            surface: vec![0; 3],
        }))
    }

    #[test]
    fn readers_wait_for_none_who_reads_another_page() {
        let cache = Cache::new(64 << 20, 100);
        // Somebody is in one shard: the other fifteen answer.
        let held = cache.lock(0);
        for number in 1..16 {
            cache.get(number, page).expect("reads");
        }
        drop(held);
        // While a page is read from disk, which takes long, even its own shard answers.
        let outer = cache.get(0, || {
            cache.get(16, page)?;
            cache.get(32, page)?;
            page()
        });
        outer.expect("reads");
        cache.get(16, || Err(())).expect("is there");
        let stats = cache.stats();
        assert_eq!((stats.hits, stats.misses, stats.evictions), (1, 18, 0));
    }
}
