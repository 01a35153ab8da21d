//! The program as its users start it.

mod commands;
mod real_site;
