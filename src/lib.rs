#![doc = include_str!("docs/house.md")]

pub mod base;
pub mod bsdf;
pub mod cli;
pub mod glare;
pub mod pages;
pub mod picture;
pub mod project;
pub mod receivers;
pub mod render;
pub mod report;
pub mod rules;
pub mod run;
pub mod site;
pub mod sky;
pub mod trace;
pub mod volume;
