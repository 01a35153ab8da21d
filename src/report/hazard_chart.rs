//! Retinal irradiance against subtended angle: the plot of Ho et al. (2011).

use crate::base::SpectralBasis;
use crate::picture::scatter::{Dots, LogAxis, Scatter, Zone};
use crate::project::Candidate;
use crate::receivers::eyes::{EyeYear, HazardPlot, Measure};

const GREEN: [u8; 3] = [0xd3, 0xe8, 0xcb];
const YELLOW: [u8; 3] = [0xfb, 0xec, 0xb5];
const RED: [u8; 3] = [0xf3, 0xc6, 0xbd];
const DOT: [u8; 3] = [0x1f, 0x4e, 0x79];
const SUN: [u8; 3] = [0x00, 0x00, 0x00];

/// Decades of the angle axis, rad.
const ANGLE_DECADES: (i32, i32) = (-4, 0);

/// Where the borders of the zones are drawn.
pub fn angles_rad() -> Vec<f64> {
    let (from, to) = ANGLE_DECADES;
    let at = |i| libm::pow(10.0, f64::from(from) + f64::from(to - from) * f64::from(i) / 200.0);
    (0..=200).map(at).collect()
}

/// An observer's year with a material.
pub fn hazard_chart(
    year: &EyeYear,
    candidate: &Candidate,
    basis: SpectralBasis,
    plot: HazardPlot,
) -> Scatter {
    let zone =
        |label: &str, color, label_at, above| Zone { label: label.into(), color, label_at, above };
    let hours = |measure| year.time(measure).map_or(0.0, |t| t.hours);
    let [green, yellow, red] = [Measure::Green, Measure::Yellow, Measure::Red].map(hours);
    let note = match basis {
        SpectralBasis::Visible => {
            " Irradiances are visible watts, about half of the full spectrum that the zones mean."
        }
        SpectralBasis::Broadband => "",
    };
    Scatter {
        title: format!("{}: hazard to the eye", year.name),
        subtitle: format!(
            "{}: {yellow:.1} h a year in which an after-image is possible, {red:.1} h in which a burn is, {green:.1} h in which neither is likely",
            candidate.name
        ),
        x: LogAxis { label: "angle that the source subtends (rad)".into(), decades: ANGLE_DECADES },
        y: LogAxis { label: "irradiance on the retina (W/cm²)".into(), decades: (-6, 3) },
        zones: vec![
            zone("low potential for an after-image", GREEN, (1.3e-4, 2e-6), Vec::new()),
            zone("potential for an after-image", YELLOW, (1.2e-2, 1.0), plot.after_image),
            zone("burn of the retina", RED, (3e-2, 60.0), plot.burn),
        ],
        dots: vec![
            Dots {
                label: "each timestep that sends light".into(),
                color: DOT,
                size: 5.0,
                points: plot.timesteps,
            },
            Dots {
                label: "the sun itself, looked at (1000 W/m²)".into(),
                color: SUN,
                size: 8.0,
                points: vec![plot.sun],
            },
        ],
        caption: format!(
            "Ho, Ghanbari, Diver (2011): pupil 2 mm, transmittance 0.5, focal length 17 mm, a blink of 0.15 s. Of each timestep the part of the PV that is worst.{note}"
        ),
    }
}
