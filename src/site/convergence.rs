use std::f64::consts::FRAC_PI_4;

/// Where true north lies in the plane of a map, at a place: degrees clockwise from the map's y axis
/// (the meridian convergence with its sign turned). `None` for reference systems that aren't known
/// here. `crs`: EPSG code; `latitude_deg` north, `longitude_deg` east.
///
/// Transverse Mercator: Snyder, "Map Projections" (USGS PP 1395), eq. 8-10, whose ellipsoidal terms
/// stay below 0.0002 degrees within three degrees of the central meridian. Swiss oblique Mercator:
/// swisstopo, "Formulas and constants for the calculation of the Swiss conformal cylindrical
/// projection", section 3.4. Dutch oblique stereographic: both on Gauss's conformal sphere, where
/// directions from the centre keep their angle. Lambert conic: Snyder, eq. 15-4.
pub(super) fn true_north_deg(crs: u32, latitude_deg: f64, longitude_deg: f64) -> Option<f64> {
    let (latitude, longitude) = (latitude_deg.to_radians(), longitude_deg.to_radians());
    let north = match projection(crs)? {
        Projection::TransverseMercator { meridian_deg } => {
            let off = longitude - meridian_deg.to_radians();
            -libm::atan(libm::tan(off) * libm::sin(latitude))
        }
        Projection::Swiss => {
            // CH1903+: Bern's old observatory, Bessel's ellipsoid.
            let sphere =
                Sphere::new(46.952_405_555_555_56, 7.439_583_333_333_333, 0.006_674_372_230_614);
            let (b, l) = sphere.place(latitude, longitude);
            let (sin0, cos0) = libm::sincos(sphere.b0);
            let down = cos0 * libm::cos(b) + sin0 * libm::sin(b) * libm::cos(l);
            -libm::atan(sin0 * libm::sin(l) / down)
        }
        Projection::Dutch => {
            let sphere =
                Sphere::new(52.156_160_555_555_55, 5.387_638_888_888_889, 0.006_674_372_230_614);
            let (b, l) = sphere.place(latitude, longitude);
            let ((sin0, cos0), (sin, cos)) = (libm::sincos(sphere.b0), libm::sincos(b));
            // Half of it in closed form: no 0 / 0 at the centre.
            let (s, c) = libm::sincos(l);
            -libm::atan2(s * (sin0 + sin), cos0 * cos + (1.0 + sin0 * sin) * c)
        }
        Projection::Conic { meridian_deg, cone } => -(longitude - meridian_deg.to_radians()) * cone,
        Projection::Mercator => 0.0,
    };
    Some(north.to_degrees())
}

enum Projection {
    TransverseMercator { meridian_deg: f64 },
    Swiss,
    Dutch,
    Conic { meridian_deg: f64, cone: f64 },
    Mercator,
}

fn projection(crs: u32) -> Option<Projection> {
    let zone = |number: u32| Some(6.0 * f64::from(number) - 183.0);
    let meridian_deg = match crs {
        2056 | 21781 => return Some(Projection::Swiss),
        28992 | 28991 | 7415 => return Some(Projection::Dutch),
        2154 => return Some(Projection::Conic { meridian_deg: 3.0, cone: 0.725_607_765 }),
        3857 => return Some(Projection::Mercator),
        // UTM: WGS 84 north and south, ETRS89, NAD83; the same with heights, or northing first.
        32601..=32660 => zone(crs - 32600),
        32701..=32760 => zone(crs - 32700),
        25828..=25838 => zone(crs - 25800),
        26901..=26923 => zone(crs - 26900),
        5554..=5556 => zone(crs - 5523),
        3043..=3049 => zone(crs - 3012),
        4647 => zone(32),
        5650 => zone(33),
        // Gauss-Krüger: Germany, Austria.
        31466..=31469 => Some(3.0 * f64::from(crs - 31464)),
        31254..=31256 => Some(10.0 + 1.0 / 3.0 + 3.0 * f64::from(crs - 31254)),
        31257..=31259 => Some(10.0 + 1.0 / 3.0 + 3.0 * f64::from(crs - 31257)),
        // Great Britain, Ireland, Sweden, Finland, Poland, Slovenia, Croatia.
        27700 => Some(-2.0),
        2157 => Some(-8.0),
        3006 => Some(15.0),
        3067 => Some(27.0),
        2180 => Some(19.0),
        3794 => Some(15.0),
        3765 => Some(16.5),
        _ => None,
    }?;
    Some(Projection::TransverseMercator { meridian_deg })
}

/// Gauss's conformal sphere about a place on an ellipsoid.
struct Sphere {
    /// Eccentricity.
    e: f64,
    /// Longitudes on the sphere grow by this.
    alpha: f64,
    /// Constant of the conformal latitude.
    k: f64,
    longitude0: f64,
    /// Latitude of the centre on the sphere.
    b0: f64,
}

impl Sphere {
    fn new(latitude_deg: f64, longitude_deg: f64, e2: f64) -> Self {
        let (latitude0, longitude0) = (latitude_deg.to_radians(), longitude_deg.to_radians());
        let cos = libm::cos(latitude0);
        let alpha = (1.0 + e2 * cos * cos * cos * cos / (1.0 - e2)).sqrt();
        let b0 = libm::asin(libm::sin(latitude0) / alpha);
        let e = e2.sqrt();
        let k = isometric(b0, 0.0) - alpha * isometric(latitude0, e);
        Self { e, alpha, k, longitude0, b0 }
    }

    /// Latitude and longitude on the sphere.
    fn place(&self, latitude: f64, longitude: f64) -> (f64, f64) {
        let q = self.alpha * isometric(latitude, self.e) + self.k;
        let b = 2.0 * (libm::atan(libm::exp(q)) - FRAC_PI_4);
        (b, self.alpha * (longitude - self.longitude0))
    }
}

/// Isometric latitude.
fn isometric(latitude: f64, e: f64) -> f64 {
    let es = e * libm::sin(latitude);
    libm::log(libm::tan(FRAC_PI_4 + latitude / 2.0)) - e / 2.0 * libm::log((1.0 + es) / (1.0 - es))
}
