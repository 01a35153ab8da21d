//! Broken input, full disks, damaged files.

mod bsdf;
mod pages;
mod project;
mod site;
mod site_formats;
mod volume;
