//! The program as its users start it.

mod commands;
mod folder;
mod real_site;
mod receivers;
