use std::collections::BTreeMap;

/// What a file of ours says about its own making. Only what decides its bytes: never a path,
/// host, time, command line, thread count or memory limit (those go to `run/log/`).
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Provenance {
    /// `glintmap 0.1.0`.
    pub program: String,
    /// Hash of the resolved settings of the project, hexadecimal.
    pub settings: String,
    /// Seed of the counter-based sampling.
    pub seed: u64,
    /// Hash of each input by its name, hexadecimal.
    pub inputs: BTreeMap<String, String>,
    /// Free words for a person: material, view, quantity.
    pub about: BTreeMap<String, String>,
}

impl Provenance {
    /// The program's name and version.
    pub const PROGRAM: &str = concat!("glintmap ", env!("CARGO_PKG_VERSION"));
}
