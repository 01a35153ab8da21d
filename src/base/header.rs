use std::collections::BTreeMap;

use super::time::SpectralBasis;

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

    /// The same as attributes of a picture, with what its watts are.
    pub fn attributes(&self, basis: SpectralBasis) -> Vec<(String, String)> {
        // In one attribute: OpenEXR's names end at 31 letters, file names don't.
        let inputs: Vec<String> =
            self.inputs.iter().map(|(name, hash)| format!("{name} {hash}")).collect();
        let mut out = vec![
            ("glintmap.program".to_owned(), self.program.clone()),
            ("glintmap.settings".to_owned(), self.settings.clone()),
            ("glintmap.seed".to_owned(), self.seed.to_string()),
            ("glintmap.inputs".to_owned(), inputs.join("\n")),
        ];
        out.extend(self.about.iter().map(|(k, v)| (format!("glintmap.{k}"), v.clone())));
        let basis = match basis {
            SpectralBasis::Visible => "visible",
            SpectralBasis::Broadband => "broadband",
        };
        out.push(("glintmap.basis".to_owned(), basis.to_owned()));
        out
    }
}
