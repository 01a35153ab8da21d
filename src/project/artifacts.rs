//! Every file that a run leaves, named once: where it lies below `run/`, which channel holds what
//! in which unit, and what people call it.
//!
//! Stages, readers and the report ask here instead of spelling names, so that what one room writes
//! is what another one reads, and a name changes in one place. `tools tidy` refuses names of such
//! files elsewhere. The layout:
//!
//! ```text
//! suns.csv  manifest.json  verdicts.json  report.html  log/
//! VIEW/                   hits.gmh  points.json  direct.exr  direct.png
//! MATERIAL/               spill/  shards/  tally.json  photons.gmp
//! MATERIAL/VIEW/          series.zarr  annual.exr  peak.exr  noise.exr  ratio.exr …
//! MATERIAL/VIEW/glare-10/ cumulative.exr  band.exr  events.csv  unfiltered/above_h.exr …
//! MATERIAL/POINTS/        sensors.csv  receivers.json  observers.csv  occurrence/01-name.csv …
//! MATERIAL/moments/       NAME.hdr  NAME.exr  NAME.png …
//! ```
//!
//! A map is one channel of an EXR file; the channel's name ends in its unit (`annual.wh_m2`).

mod maps;

use std::path::{Path, PathBuf};

use super::folder::Folder;
use super::shard::Shard;
use crate::base::TileRect;

use maps::analysis;
pub use maps::{GlareMap, Map, SeriesOf, irradiance_unit, quantity_words};

/// Folder of what observers and regions receive, and name of the set of their points.
pub const RECEIVERS: &str = "receivers";
/// Folder of the pictures of luminances.
pub const MOMENTS: &str = "moments";
/// The timesteps and their suns.
pub const SUNS: &str = "suns.csv";
/// What was made from what.
pub const MANIFEST: &str = "manifest.json";
/// What the rules say of each receiver.
pub const VERDICTS: &str = "verdicts.json";
/// The report.
pub const REPORT: &str = "report.html";
/// Commands, times, threads: a JSON object a line.
pub const LOG: &str = "log/run.jsonl";
/// The drawing of the site, beside the project file.
pub const SITE_PLAN: &str = "site.png";

/// A receiver of a set: its number in the set, from 0, and its name.
#[derive(Clone, Copy, Debug)]
pub struct ReceiverId<'a> {
    /// In the order of the project file.
    pub number: usize,
    /// As in the project file.
    pub name: &'a str,
}

/// What is kept of one receiver.
#[derive(Clone, Copy, Debug)]
pub enum ReceiverFile {
    /// The timesteps at which it is lit, as a table.
    Occurrence,
    /// The chart of how strongly it is lit.
    StrengthChart,
    /// The chart of which PV surface lights it.
    SurfaceChart,
    /// The chart of the hazard to an observer's eye.
    HazardChart,
}

/// What is kept of the eyes of all observers.
#[derive(Clone, Copy, Debug)]
pub enum EyesFile {
    /// Their years.
    Years,
    /// A row for each timestep with light.
    Timesteps,
    /// A row for each day with glare.
    Days,
    /// A row for each measure.
    Months,
}

/// What is kept of a picture of luminances.
#[derive(Clone, Copy, Debug)]
pub enum MomentFile {
    /// Radiances for Radiance and evalglare.
    Radiance,
    /// Luminances.
    Luminance,
    /// What an eye sees, for people.
    Picture,
    /// Luminances in colours, for people.
    LuminancePicture,
    /// What the eye at the view point gets of the PV.
    Facts,
}

impl MomentFile {
    /// All of them, in the order in which they are written.
    pub const ALL: [Self; 5] =
        [Self::Radiance, Self::Luminance, Self::Picture, Self::LuminancePicture, Self::Facts];
    /// The channel of [`MomentFile::Luminance`].
    pub const CHANNEL: &str = "luminance.cd_m2";
}

/// Names below `run/`.
impl Folder {
    /// The timesteps.
    pub fn suns(&self) -> PathBuf {
        SUNS.into()
    }

    /// Per pixel: what the view sees.
    pub fn hits(&self, view: &str) -> PathBuf {
        Path::new(view).join("hits.gmh")
    }

    /// Of a set of sensors: whose points they are.
    pub fn points(&self, set: &str) -> PathBuf {
        Path::new(set).join("points.json")
    }

    /// The daylight background.
    pub fn direct(&self, view: &str) -> PathBuf {
        Path::new(view).join("direct.exr")
    }

    /// The same, for people.
    pub fn direct_picture(&self, view: &str) -> PathBuf {
        Path::new(view).join("direct.png")
    }

    /// Where photons wait to be sorted.
    pub fn spill(&self, candidate: &str) -> PathBuf {
        Path::new(candidate).join("spill")
    }

    /// Where shares of a candidate's photons wait to be joined.
    pub fn shards(&self, candidate: &str) -> PathBuf {
        Path::new(candidate).join("shards")
    }

    /// Where the photons of a share wait.
    pub fn shard_spill(&self, candidate: &str, shard: Shard) -> PathBuf {
        self.shards(candidate).join(shard.name()).join("spill")
    }

    /// What says that a share is complete.
    pub fn shard_tally(&self, candidate: &str, shard: Shard) -> PathBuf {
        self.shards(candidate).join(shard.name()).join("traced.json")
    }

    /// Where the photons went: counts and flux.
    pub fn tally(&self, candidate: &str) -> PathBuf {
        Path::new(candidate).join("tally.json")
    }

    /// The photon store.
    pub fn store(&self, candidate: &str) -> PathBuf {
        Path::new(candidate).join("photons.gmp")
    }

    fn of_view(&self, candidate: &str, view: &str, name: &str) -> PathBuf {
        Path::new(candidate).join(view).join(name)
    }

    /// The EXR file that holds a map.
    pub fn exr(&self, candidate: &str, view: &str, map: Map) -> PathBuf {
        self.of_view(candidate, view, &format!("{}.exr", map.stem()))
    }

    /// A map as a NumPy array.
    pub fn npy(&self, candidate: &str, view: &str, map: Map) -> PathBuf {
        self.of_view(candidate, view, &format!("{}.npy", map.stem()))
    }

    /// A map as a Radiance picture.
    pub fn hdr(&self, candidate: &str, view: &str, map: Map) -> PathBuf {
        self.of_view(candidate, view, &format!("{}.hdr", map.stem()))
    }

    /// A map in colours, for people.
    pub fn png(&self, candidate: &str, view: &str, map: Map) -> PathBuf {
        self.of_view(candidate, view, &format!("{}.png", map.picture()))
    }

    /// The time series of the irradiance that the project asks for.
    pub fn series(&self, candidate: &str, view: &str) -> PathBuf {
        self.of_view(candidate, view, "series.zarr")
    }

    /// One of the time series.
    pub fn series_of(&self, candidate: &str, view: &str, series: SeriesOf) -> PathBuf {
        self.of_view(candidate, view, &format!("{}.zarr", series.named("series")))
    }

    /// What was found out about the tiles of a series that isn't finished.
    pub fn tile_notes(&self, candidate: &str, view: &str, series: SeriesOf) -> PathBuf {
        self.of_view(candidate, view, &format!("{}.notes", series.named("series")))
    }

    /// Where the year's sums of a view that is integrated directly wait for the last tile.
    pub fn waiting_tiles(&self, candidate: &str, view: &str) -> PathBuf {
        self.of_view(candidate, view, "annual-tiles")
    }

    /// The sums of a tile that wait.
    pub fn waiting_tile(&self, candidate: &str, view: &str, tile: TileRect) -> PathBuf {
        let name = format!("{}-{}.npy", tile.row, tile.column);
        self.waiting_tiles(candidate, view).join(name)
    }

    /// The events of an analysis, as a table.
    pub fn events(&self, candidate: &str, view: &str, threshold_w_m2: f64) -> PathBuf {
        self.of_view(candidate, view, &format!("{}/events.csv", analysis(threshold_w_m2)))
    }

    /// The events of an analysis, as points of a map.
    pub fn event_points(&self, candidate: &str, view: &str, threshold_w_m2: f64) -> PathBuf {
        self.of_view(candidate, view, &format!("{}/events.geojson", analysis(threshold_w_m2)))
    }

    /// The photons that crossed discs in free air.
    pub fn air(&self, candidate: &str, set: &str) -> PathBuf {
        self.of_view(candidate, set, "air.gmp")
    }

    /// Where these wait to be sorted.
    pub fn air_spill(&self, candidate: &str, set: &str) -> PathBuf {
        self.of_view(candidate, set, "air-spill")
    }

    /// What arrives at the receivers of a set.
    pub fn received(&self, candidate: &str, set: &str) -> PathBuf {
        self.of_view(candidate, set, "receivers.json")
    }

    /// What arrives at the points of a set, as a table.
    pub fn sensors(&self, candidate: &str, set: &str) -> PathBuf {
        self.of_view(candidate, set, "sensors.csv")
    }

    /// What is kept of one receiver of a set.
    pub fn receiver(
        &self,
        candidate: &str,
        set: &str,
        receiver: ReceiverId<'_>,
        file: ReceiverFile,
    ) -> PathBuf {
        let plain: String = receiver
            .name
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' })
            .collect();
        let words: Vec<&str> = plain.split('-').filter(|w| !w.is_empty()).collect();
        let mut short = words.join("-");
        short.truncate(40);
        let end = match file {
            ReceiverFile::Occurrence => ".csv",
            ReceiverFile::StrengthChart => ".png",
            ReceiverFile::SurfaceChart => "-pv.png",
            ReceiverFile::HazardChart => "-hazard.png",
        };
        let name = format!("occurrence/{:02}-{short}{end}", receiver.number + 1);
        self.of_view(candidate, set, &name)
    }

    /// What is kept of the eyes of all observers.
    pub fn eyes(&self, candidate: &str, file: EyesFile) -> PathBuf {
        let name = match file {
            EyesFile::Years => "observers.json",
            EyesFile::Timesteps => "observers.csv",
            EyesFile::Days => "observers-daily.csv",
            EyesFile::Months => "observers-monthly.csv",
        };
        self.of_view(candidate, RECEIVERS, name)
    }

    /// What is kept of a picture of luminances.
    pub fn moment(&self, candidate: &str, moment: &str, file: MomentFile) -> PathBuf {
        let end = match file {
            MomentFile::Radiance => ".hdr",
            MomentFile::Luminance => ".exr",
            MomentFile::Picture => ".png",
            MomentFile::LuminancePicture => "-luminance.png",
            MomentFile::Facts => ".json",
        };
        self.of_view(candidate, MOMENTS, &format!("{moment}{end}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Irradiance;
    use crate::glare::YearMap;

    #[test]
    fn names_are_those_that_the_documentation_promises() {
        let folder = Folder::new(PathBuf::from("run"));
        let name = |map| folder.exr("standard", "plan", map).to_string_lossy().replace('\\', "/");
        let run = GlareMap::Unfiltered(YearMap::LongestRun);
        assert_eq!(name(Map::AnnualNormal), "standard/plan/annual.exr");
        assert_eq!(
            name(Map::Glare(10.0, run)),
            "standard/plan/glare-10/unfiltered/longest_run_h.exr"
        );
        let series = |quantity| SeriesOf { quantity, asked: Irradiance::Surface };
        let of = |quantity| folder.series_of("a", "b", series(quantity));
        assert_eq!(of(Irradiance::Surface), folder.series("a", "b"));
        assert_eq!(of(Irradiance::FacingBeam), Path::new("a/b/series_normal.zarr"));
        let receiver = ReceiverId { number: 0, name: "Église, tower" };
        let chart = folder.receiver("a", "receivers", receiver, ReceiverFile::SurfaceChart);
        assert_eq!(chart, Path::new("a/receivers/occurrence/01-glise-tower-pv.png"));
    }
}
