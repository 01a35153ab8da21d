//! Rays through pixels, for each of Radiance's six projections.
//!
//! A picture of ours must lie on top of one by `rpict`, so the formulas, their limits and even the
//! tolerance follow Radiance's `image.c` and `vwrays`; tests compare ray by ray.

use glam::{DVec3, dvec3};
use libm::{acos, atan2, cos, sin, tan};
use std::f64::consts::PI;

use super::error::Error;
use crate::base::limits;

/// Radiance's FTINY: lengths and angles below it count as zero.
const TINY: f64 = 1e-6;

/// How a view maps directions to the picture; Radiance's `-vt` letters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Projection {
    /// `-vtv`: sizes are angles, degrees.
    Perspective,
    /// `-vtl`: sizes are metres.
    Parallel,
    /// `-vth`: hemispherical fisheye.
    Hemispherical,
    /// `-vta`: angular fisheye.
    Angular,
    /// `-vtc`: cylindrical panorama.
    Cylindrical,
    /// `-vts`: planispheric (stereographic) fisheye.
    Planisphere,
}

/// The ray through a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewRay {
    /// Where it starts: on the fore clipping plane.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
    /// Distance from `origin` to the aft clipping plane, m; infinite without one.
    pub limit_m: f64,
}

/// What the options of a view say, before they are checked.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::render) struct ViewOptions {
    pub projection: Projection,
    pub point: DVec3,
    pub direction: DVec3,
    pub up: DVec3,
    pub horizontal: f64,
    pub vertical: f64,
    pub fore_m: f64,
    pub aft_m: f64,
    pub shift: f64,
    pub lift: f64,
}

impl Default for ViewOptions {
    /// Radiance's `stdview`.
    fn default() -> Self {
        Self {
            projection: Projection::Perspective,
            point: DVec3::ZERO,
            direction: DVec3::Y,
            up: DVec3::Z,
            horizontal: 45.0,
            vertical: 45.0,
            fore_m: 0.0,
            aft_m: 0.0,
            shift: 0.0,
            lift: 0.0,
        }
    }
}

/// A view as Radiance has it, with a size in pixels. The size is taken as it is (`-pa 0`): pixels
/// are as wide and high as the view's angles make them.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    options: ViewOptions,
    columns: usize,
    rows: usize,
    /// Unit vector along the axis (the options keep it as it was given).
    axis: DVec3,
    /// Unit vector to the right of the picture.
    right: DVec3,
    /// Unit vector to the top of the picture.
    above: DVec3,
    /// Width and height of the picture at distance one, in the projection's own measure
    /// (Radiance's `sqrt(hn2)`, `sqrt(vn2)`).
    extent: [f64; 2],
}

impl View {
    pub(in crate::render) fn from_options(
        options: ViewOptions,
        columns: usize,
        rows: usize,
    ) -> Result<Self, Error> {
        let fault = |what: String| Err(Error::View { what });
        let edge = 1..=limits::MAX_VIEW_EDGE;
        if !edge.contains(&columns) || !edge.contains(&rows) {
            return fault(format!(
                "its size is {columns} x {rows} pixels, expected 1 to {} along each edge",
                limits::MAX_VIEW_EDGE
            ));
        }
        if columns * rows > limits::MAX_VIEW_PIXELS {
            return fault(format!(
                "its size of {columns} x {rows} makes {} pixels, at most {} are possible",
                columns * rows,
                limits::MAX_VIEW_PIXELS
            ));
        }
        let o = &options;
        if o.fore_m < 0.0 || o.aft_m < 0.0 || (o.aft_m > TINY && o.aft_m <= o.fore_m) {
            return fault(format!(
                "clipping planes -vo {} -va {}: expected 0 or more, and aft behind fore (or 0 for none)",
                o.fore_m, o.aft_m
            ));
        }
        let Some(direction) = o.direction.try_normalize() else {
            return fault("the direction -vd is zero".to_owned());
        };
        let Some(up) = o.up.try_normalize() else {
            return fault("the up vector -vu is zero".to_owned());
        };
        let across = direction.cross(up);
        if across.length() <= TINY {
            return fault(
                "the up vector -vu is parallel to the direction -vd; for a view from above take -vu 0 1 0"
                    .to_owned(),
            );
        }
        let right = across.normalize();
        let above = right.cross(direction).normalize();
        let extent = [
            extent_of(o.projection, o.horizontal, "-vh", true)?,
            extent_of(o.projection, o.vertical, "-vv", false)?,
        ];
        Ok(Self { options, columns, rows, axis: direction, right, above, extent })
    }

    /// Width in pixels.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Height in pixels.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The kind of view.
    pub fn projection(&self) -> Projection {
        self.options.projection
    }

    /// The view point, m.
    pub fn point(&self) -> DVec3 {
        self.options.point
    }

    /// Unit vector along the view's axis.
    pub fn direction(&self) -> DVec3 {
        self.axis
    }

    /// Unit vectors to the right and to the top of the picture: where a scale bar and a north
    /// arrow point.
    pub fn axes(&self) -> [DVec3; 2] {
        [self.right, self.above]
    }

    /// `-vh` and `-vv`: degrees, or metres in a parallel view.
    pub fn size(&self) -> [f64; 2] {
        [self.options.horizontal, self.options.vertical]
    }

    /// The same view with another size in pixels.
    ///
    /// # Errors
    /// [`Error::View`] for a size out of bounds.
    pub fn resized(&self, columns: usize, rows: usize) -> Result<Self, Error> {
        Self::from_options(self.options.clone(), columns, rows)
    }

    pub(in crate::render) fn options(&self) -> &ViewOptions {
        &self.options
    }

    /// The ray through the centre of a pixel, as `vwrays` gives it; row 0 is at the top. `None`
    /// where the projection has no direction (the corners of a fisheye).
    pub fn ray(&self, column: usize, row: usize) -> Option<ViewRay> {
        self.ray_at(column as f64 + 0.5, row as f64 + 0.5)
    }

    /// The ray through any place of the picture, in pixels from its top left corner. Formulas:
    /// Radiance, `viewray` in src/common/image.c.
    pub fn ray_at(&self, column: f64, row: f64) -> Option<ViewRay> {
        let o = &self.options;
        let x = column / self.columns as f64 + o.shift - 0.5;
        let y = 1.0 - row / self.rows as f64 + o.lift - 0.5;
        let [width, height] = self.extent;
        let mix = |z: f64, x: f64, y: f64| self.axis * z + self.right * x + self.above * y;
        // Unnormalised direction; the fore plane lies at `fore` of its lengths.
        let toward = match o.projection {
            Projection::Parallel => {
                let origin = o.point + mix(o.fore_m, x * width, y * height);
                let limit_m = self.limit(1.0);
                return Some(ViewRay { origin, direction: self.axis, limit_m });
            }
            Projection::Perspective => mix(1.0, x * width, y * height),
            Projection::Hemispherical => {
                let (x, y) = (x * width, y * height);
                let z2 = 1.0 - x * x - y * y;
                if z2 < 0.0 {
                    return None;
                }
                mix(z2.sqrt(), x, y)
            }
            Projection::Cylindrical => {
                let angle = x * width;
                mix(cos(angle), sin(angle), y * height)
            }
            Projection::Angular => {
                let (x, y) = (x * o.horizontal / 180.0, y * o.vertical / 180.0);
                let d2 = x * x + y * y;
                if d2 > 1.0 {
                    return None;
                }
                let d = d2.sqrt();
                let z = cos(PI * d);
                let scale = if d <= TINY { PI } else { (1.0 - z * z).max(0.0).sqrt() / d };
                mix(z, x * scale, y * scale)
            }
            Projection::Planisphere => {
                let (x, y) = (x * width, y * height);
                let d = x * x + y * y;
                let z = (1.0 - d) / (1.0 + d);
                mix(z, x * (1.0 + z), y * (1.0 + z))
            }
        };
        let origin = o.point + toward * o.fore_m;
        let length = toward.length();
        let limit_m = match o.projection {
            Projection::Perspective | Projection::Cylindrical => self.limit(length),
            _ => self.limit(1.0),
        };
        Some(ViewRay { origin, direction: toward / length, limit_m })
    }

    fn limit(&self, stretch: f64) -> f64 {
        let o = &self.options;
        if o.aft_m > TINY { (o.aft_m - o.fore_m) * stretch } else { f64::INFINITY }
    }

    /// Where a point appears, in pixels from the top left corner of the picture: the centre of the
    /// first pixel is (0.5, 0.5). Places outside the picture are given too, so that lines can be
    /// drawn to them. `None` where the point can't appear: behind the view, or cut off by a
    /// clipping plane. Formulas: Radiance, `viewloc` in src/common/image.c.
    pub fn project(&self, point: DVec3) -> Option<(f64, f64)> {
        let o = &self.options;
        let away = point - o.point;
        let depth = match o.projection {
            Projection::Parallel | Projection::Perspective => away.dot(self.axis),
            Projection::Cylindrical => {
                let (a, b) = (away.dot(self.right), away.dot(self.axis));
                (a * a + b * b).sqrt()
            }
            _ => away.length(),
        };
        if depth <= o.fore_m || (o.aft_m > TINY && depth >= o.aft_m) {
            return None;
        }
        if o.projection == Projection::Parallel {
            let [width, height] = self.extent;
            return self.pixels(away.dot(self.right) / width, away.dot(self.above) / height);
        }
        self.project_direction(away)
    }

    /// Where a direction appears, as that of a point infinitely far away (the sun), whatever the
    /// clipping planes; see [`View::project`]. `None` behind the view and in parallel views.
    pub fn project_direction(&self, direction: DVec3) -> Option<(f64, f64)> {
        let o = &self.options;
        let d = direction.try_normalize()?;
        let local = dvec3(d.dot(self.right), d.dot(self.above), d.dot(self.axis));
        let [width, height] = self.extent;
        let (x, y) = match o.projection {
            Projection::Parallel => return None,
            Projection::Perspective if local.z > TINY => {
                (local.x / local.z / width, local.y / local.z / height)
            }
            Projection::Hemispherical if local.z >= 0.0 => (local.x / width, local.y / height),
            Projection::Perspective | Projection::Hemispherical => return None,
            Projection::Cylindrical => {
                let across = (local.x * local.x + local.z * local.z).sqrt();
                if across <= TINY {
                    return None;
                }
                (atan2(local.x, local.z) / width, local.y / across / height)
            }
            Projection::Angular => {
                let across = (local.x * local.x + local.y * local.y).sqrt();
                if across <= TINY {
                    (if local.z > 0.0 { 0.0 } else { PI / width }, 0.0)
                } else {
                    let stretch = atan2(across, local.z) / across;
                    (local.x * stretch / width, local.y * stretch / height)
                }
            }
            Projection::Planisphere => {
                let scale = 1.0 + local.z;
                if scale <= TINY {
                    return None;
                }
                (local.x / scale / width, local.y / scale / height)
            }
        };
        self.pixels(x, y)
    }

    fn pixels(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let column = (x + 0.5 - self.options.shift) * self.columns as f64;
        let row = (0.5 - y + self.options.lift) * self.rows as f64;
        (column.is_finite() && row.is_finite()).then_some((column, row))
    }

    /// The pixel (column, row) in which a point appears, if it lies in the picture; whether
    /// something stands before it isn't asked.
    pub fn pixel_of(&self, point: DVec3) -> Option<(usize, usize)> {
        let (column, row) = self.project(point)?;
        let inside =
            column >= 0.0 && row >= 0.0 && column < self.columns as f64 && row < self.rows as f64;
        inside.then_some((column as usize, row as usize))
    }

    /// Angle between the view's axis and a direction, degrees.
    pub fn angle_deg(&self, direction: DVec3) -> f64 {
        let c = self.axis.dot(direction.normalize_or_zero()).clamp(-1.0, 1.0);
        acos(c) * 180.0 / PI
    }
}

/// Radiance's `sqrt(hn2)` or `sqrt(vn2)` after the bounds of `setview`.
fn extent_of(
    projection: Projection,
    size: f64,
    option: &str,
    horizontal: bool,
) -> Result<f64, Error> {
    let half = size * (PI / 360.0);
    let (most, open, extent) = match projection {
        Projection::Parallel => (f64::INFINITY, true, size),
        Projection::Perspective => (180.0, true, 2.0 * tan(half)),
        Projection::Cylindrical if horizontal => (360.0, false, 2.0 * half),
        Projection::Cylindrical => (180.0, true, 2.0 * tan(half)),
        Projection::Angular => (360.0, false, 2.0 * half),
        Projection::Hemispherical => (180.0, false, 2.0 * sin(half)),
        Projection::Planisphere => (360.0, true, 2.0 * sin(half) / (1.0 + cos(half))),
    };
    let fits = if open { size < most - TINY } else { size <= most + TINY };
    if size > TINY && fits {
        return Ok(extent);
    }
    let what = match projection {
        Projection::Parallel => format!("{option} is {size}, expected a size above 0 metres"),
        _ => {
            let bound = if open { "below" } else { "up to" };
            format!("{option} is {size}, expected an angle above 0 and {bound} {most} degrees")
        }
    };
    Err(Error::View { what })
}
