//! The photon stores of a run.

use crate::pages::{Access, OpenOptions, Store};
use crate::project::Candidate;
use crate::run::error::Error;
use crate::run::job::Job;

/// The photons of a material.
pub(super) fn open_store(job: &Job<'_>, candidate: &Candidate) -> Result<Store, Error> {
    let path = job.folder.at(&job.folder.store(&candidate.name));
    let options = OpenOptions { cache_bytes: job.options.page_cache_bytes, access: Access::Mapped };
    Ok(Store::open(&path, &options)?)
}

/// The photons that tell which PV surface sends; `None` where nothing is made of photons (a store
/// that still lies there is left over from other settings).
pub(super) fn telling_store(job: &Job<'_>, candidate: &Candidate) -> Result<Option<Store>, Error> {
    job.resolved.needs_photons().then(|| open_store(job, candidate)).transpose()
}
