//! Broken input, full disks, damaged files.

mod pages;
mod project;
mod site;
mod site_formats;
mod volume;
