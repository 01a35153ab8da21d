//! The built-in case study: own design, after the situation that the paper describes (a modern
//! church on a rise, a hillside hamlet in the west). Everything follows from the numbers in here;
//! the same bytes come out everywhere.

mod church;
mod export;
mod house;
mod project;
mod shape;
mod site_plan;
mod terrain;
mod tiny;
mod tree;

pub use export::{File, write};

use shape::Model;

/// The scene in the files that it is written to.
fn models() -> Vec<(&'static str, &'static str, Model)> {
    vec![
        ("terrain.rad", "the hillside and its streets", terrain::model()),
        ("church.rad", "the church: halls, courtyard, tower", church::building()),
        ("houses.rad", "the hamlet", house::model()),
        ("trees.rad", "the trees", tree::model()),
        ("pv.rad", "the three roof sections that become photovoltaics", church::pv()),
    ]
}

/// All files of the case study.
pub fn files() -> Vec<File> {
    let mut files: Vec<File> = models()
        .into_iter()
        .map(|(name, about, model)| export::radiance(name, about, &model))
        .collect();
    files.push(File { name: "project.toml", text: project::project() });
    files.push(File { name: "README.md", text: project::README.to_owned() });
    files
}

/// All files of the tiny project.
pub fn tiny_files() -> Vec<File> {
    tiny::files()
}

#[cfg(test)]
mod tests;
