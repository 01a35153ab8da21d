//! The program as its users start it.

mod air;
mod bsdf;
mod commands;
mod folder;
mod real_site;
mod receivers;
