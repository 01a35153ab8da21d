//! `glintmap picture`: pictures from maps in files, with Radiance's options where it has them.
//!
//! Radiance's `falsecolor` takes words such as `-log` and `-cl` with one dash; clap knows two.
//! [`with_two_dashes`] adds the second one before the command line is parsed.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use serde_json::json;

use super::Context;
use crate::base::Grid;
use crate::picture::compose::{self, Contours};
use crate::picture::tonemap::{Exposure, tonemap};
use crate::picture::{Error, Figure, Palette, Rgb, Scale, files, png, unit_label};

/// Pictures from maps: falsecolours, composites over a background, ratios, tone mapping
#[derive(Debug, clap::Subcommand)]
pub(super) enum Command {
    /// Colour a map by its values, with a legend
    #[command(
        after_help = "Example: glintmap picture falsecolor annual.exr annual.png -s 3000 -log 3"
    )]
    Falsecolor(Falsecolor),
    /// Colour a map and lay it over a picture in grey
    #[command(
        after_help = "Example: glintmap picture composite annual.exr annual.png -p direct.exr -log 3"
    )]
    Composite(Falsecolor),
    /// Colour the quotient of two maps: blue below 1, yellow to red above
    ///
    /// Where the old map is 0 the quotient is 0 and gets no colour.
    #[command(
        after_help = "Example: glintmap picture ratio new.exr old.exr ratio.png -p direct.exr"
    )]
    Ratio(Ratio),
    /// A picture for the screen: exposed by its own brightness
    #[command(after_help = "Example: glintmap picture tonemap direct.exr direct.png")]
    Tonemap(Tonemap),
}

#[derive(Debug, clap::Args)]
pub(super) struct Falsecolor {
    /// The map (.exr, .hdr, .tif, .npy)
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The picture to write (.png)
    #[arg(value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    drawing: Drawing,
}

#[derive(Debug, clap::Args)]
pub(super) struct Ratio {
    /// The new map
    #[arg(value_name = "NEW")]
    new: PathBuf,
    /// The map to compare with
    #[arg(value_name = "OLD")]
    old: PathBuf,
    /// The picture to write (.png)
    #[arg(value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    drawing: Drawing,
}

#[derive(Debug, clap::Args)]
pub(super) struct Tonemap {
    /// The picture (.exr, .hdr, .tif)
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The picture to write (.png)
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// Drop the colours
    #[arg(long)]
    grey: bool,
    /// Factor on the values instead of one from the picture; 1 is white
    #[arg(long, value_name = "FACTOR")]
    exposure: Option<f64>,
}

/// The options of Radiance's falsecolor, by their names there (-log, -lw, -lh, -pal, -cl, -cb
/// with one dash or two).
#[derive(Debug, clap::Args)]
struct Drawing {
    /// Upper end of the scale, or `auto`: a round number above 99.9 % of the values
    #[arg(short = 's', long = "scale", value_name = "MAX", default_value = "auto")]
    scale: String,
    /// Words of the legend [default: the channel's name]
    #[arg(short = 'l', long = "label", value_name = "TEXT")]
    label: Option<String>,
    /// Breadth of the legend's bar in pixels; 0: no legend
    #[arg(long = "lw", value_name = "PIXELS")]
    legend_breadth: Option<u32>,
    /// Length of the legend's bar in pixels; 0: no legend
    #[arg(long = "lh", value_name = "PIXELS")]
    legend_length: Option<u32>,
    /// Logarithmic scale over so many decades
    #[arg(long = "log", value_name = "DECADES")]
    decades: Option<f64>,
    /// Number of equal parts that the legend marks [default: round numbers]
    #[arg(short = 'n', long = "divisions", value_name = "N")]
    divisions: Option<usize>,
    /// Palette: plasma (or def), inferno, viridis, cividis, turbo, spec, hot, pm3d, eco, grey
    #[arg(long = "pal", value_name = "NAME")]
    palette: Option<String>,
    /// Factor on the values, such as 179 for the luminance of a Radiance picture
    #[arg(short = 'm', long = "multiplier", value_name = "FACTOR", default_value_t = 1.0)]
    multiplier: f64,
    /// Picture to lay the colours over, in grey
    #[arg(short = 'p', long = "background", value_name = "PICTURE")]
    background: Option<PathBuf>,
    /// Contour lines instead of areas
    #[arg(long = "cl", conflicts_with = "contour_bands")]
    contour_lines: bool,
    /// Contour bands: one colour for each part of the legend
    #[arg(long = "cb")]
    contour_bands: bool,
    /// Mark the smallest and the largest value
    #[arg(short = 'e', long = "extrema")]
    extrema: bool,
    /// Channel of the map, where it has several
    #[arg(long, value_name = "NAME")]
    channel: Option<String>,
    /// Unit of the values after -m [default: from the channel's name]
    #[arg(long, value_name = "UNIT")]
    unit: Option<String>,
    /// Title above the picture
    #[arg(long, value_name = "TEXT", default_value = "")]
    title: String,
    /// Line below the title
    #[arg(long, value_name = "TEXT", default_value = "")]
    subtitle: String,
}

/// Gives Radiance's long option names, which have one dash, the two that our parser expects:
/// after the word `picture` only.
pub(super) fn with_two_dashes(
    arguments: impl Iterator<Item = OsString>,
) -> impl Iterator<Item = OsString> {
    let mut after = false;
    arguments.map(move |word| {
        let radiance = ["-log", "-lw", "-lh", "-pal", "-cl", "-cb"];
        if after && radiance.iter().any(|name| word == *name) {
            let mut longer = OsString::from("-");
            longer.push(word);
            return longer;
        }
        after |= word == "picture";
        word
    })
}

pub(super) fn run(command: &Command, context: &Context) -> anyhow::Result<()> {
    match command {
        Command::Falsecolor(arguments) => falsecolor(arguments, context),
        Command::Composite(arguments) => {
            if arguments.drawing.background.is_none() {
                return Err(Error::Setting {
                    option: "-p",
                    value: String::new(),
                    what: "composite needs the picture that lies below; `falsecolor` does without"
                        .into(),
                }
                .into());
            }
            falsecolor(arguments, context)
        }
        Command::Ratio(arguments) => ratio(arguments, context),
        Command::Tonemap(arguments) => {
            png_name(&arguments.output)?;
            let picture = colors(&arguments.input)?;
            let exposure = arguments.exposure.map_or(Exposure::Auto, Exposure::Factor);
            let mapped = tonemap(&picture, exposure, arguments.grey);
            png::write(&arguments.output, &mapped, &[])?;
            let document = json!({ "output": arguments.output });
            context.print(&document, &arguments.output.display().to_string())
        }
    }
}

fn falsecolor(arguments: &Falsecolor, context: &Context) -> anyhow::Result<()> {
    png_name(&arguments.output)?;
    let (name, data) = arguments.drawing.values(&arguments.input)?;
    let unit = arguments.drawing.unit.clone().unwrap_or_else(|| unit_label(&name));
    let max = arguments.drawing.max()?;
    let scale = Scale::fitted([&data], max, arguments.drawing.decades, &unit);
    let label = name.rsplit_once('.').map_or(name.as_str(), |(quantity, _)| quantity);
    arguments.drawing.draw(&data, scale, label, &arguments.output, context)
}

fn ratio(arguments: &Ratio, context: &Context) -> anyhow::Result<()> {
    png_name(&arguments.output)?;
    let (_, new) = arguments.drawing.values(&arguments.new)?;
    let (_, old) = arguments.drawing.values(&arguments.old)?;
    let data = compose::ratio(&new, &old)?;
    let max = arguments.drawing.max()?;
    let scale = match arguments.drawing.decades {
        None => Scale::fitted_ratio([&data], max),
        decades => Scale::fitted([&data], max, decades, ""),
    };
    arguments.drawing.draw(&data, scale, "new / old", &arguments.output, context)
}

impl Drawing {
    fn max(&self) -> Result<Option<f64>, Error> {
        if self.scale == "auto" || self.scale == "a" {
            return Ok(None);
        }
        self.scale.parse().map(Some).map_err(|_| Error::Setting {
            option: "-s",
            value: self.scale.clone(),
            what: "expected a number or `auto`".into(),
        })
    }

    fn values(&self, path: &Path) -> Result<(String, Grid<f32>), Error> {
        let (name, grid) = files::read(path)?.values(self.channel.as_deref(), path)?;
        let factor = self.multiplier;
        if factor == 1.0 {
            return Ok((name, grid));
        }
        Ok((name, grid.map(|&v| (f64::from(v) * factor) as f32)))
    }

    fn draw(
        &self,
        data: &Grid<f32>,
        mut scale: Scale,
        label: &str,
        output: &Path,
        context: &Context,
    ) -> anyhow::Result<()> {
        if let Some(name) = &self.palette {
            scale.palette = Palette::parse(name)?;
        }
        scale.divisions = self.divisions;
        let background = self.background.as_deref().map(colors).transpose()?;
        let mut figure = Figure::new(data, scale);
        figure.background = background.as_ref();
        figure.title = self.title.clone();
        figure.subtitle = self.subtitle.clone();
        figure.legend = self.label.clone().unwrap_or_else(|| label.to_owned());
        figure.bare = "0".into();
        figure.extrema = self.extrema;
        figure.contours = match (self.contour_lines, self.contour_bands) {
            (true, _) => Contours::Lines,
            (_, true) => Contours::Bands,
            _ => Contours::None,
        };
        figure.legend_size = match (self.legend_length, self.legend_breadth) {
            (None, None) => None,
            (length, breadth) => Some([length.unwrap_or(400), breadth.unwrap_or(24)]),
        };
        figure.write_png(output, &[])?;
        let scale = &figure.scale;
        let document = json!({
            "output": output, "columns": data.columns(), "rows": data.rows(),
            "min": scale.min, "max": scale.max, "unit": scale.unit,
        });
        let text = format!("{}: {} to {} {}", output.display(), scale.min, scale.max, scale.unit);
        context.print(&document, text.trim_end())
    }
}

fn colors(path: &Path) -> Result<Rgb, Error> {
    let channels = files::read(path)?;
    match channels.rgb() {
        Some(rgb) => Ok(rgb),
        // One channel is as good as grey.
        None => Ok(channels.values(None, path)?.1.map(|&v| [v; 3])),
    }
}

fn png_name(path: &Path) -> Result<(), Error> {
    if files::Kind::of(path)? == files::Kind::Png {
        return Ok(());
    }
    Err(Error::Unsupported {
        path: path.to_owned(),
        what: "figures are written as PNG: expected a name that ends in .png".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radiance_s_names_get_their_second_dash_after_the_word_picture() {
        let words = |line: &str| {
            let words: Vec<OsString> = line.split(' ').map(OsString::from).collect();
            let words: Vec<_> = with_two_dashes(words.into_iter()).collect();
            words.join(std::ffi::OsStr::new(" ")).into_string().expect("text")
        };
        let line = "glintmap picture falsecolor a.hdr b.png -log 3 -lw 0 -s 5 -cl -e";
        let longer = "glintmap picture falsecolor a.hdr b.png --log 3 --lw 0 -s 5 --cl -e";
        assert_eq!(words(line), longer);
        assert_eq!(words("glintmap inspect -log"), "glintmap inspect -log");
    }
}
