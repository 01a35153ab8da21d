//! Where everything stands: the hamlet's plan as data. Metres; x east, y north.

/// Half the width of a street, m.
pub(super) const STREET_HALF_WIDTH_M: f64 = 2.6;

/// The middles of the streets.
pub(super) const STREETS: &[&[[f64; 2]]] = &[
    // The village street, between the church and the hillside.
    &[
        [-27.0, -100.0],
        [-30.0, -70.0],
        [-33.0, -45.0],
        [-35.0, -20.0],
        [-34.0, 5.0],
        [-31.0, 28.0],
        [-27.0, 42.0],
        [-24.0, 62.0],
        [-26.0, 100.0],
    ],
    // East, south of the church.
    &[[-33.0, -45.0], [-10.0, -42.0], [20.0, -44.0], [46.0, -42.0], [70.0, -36.0], [100.0, -34.0]],
    // East, north of the church.
    &[[-27.0, 42.0], [0.0, 44.0], [30.0, 43.0], [52.0, 36.0], [66.0, 14.0], [70.0, -36.0]],
    // Up the hill.
    &[
        [-34.0, -32.0],
        [-52.0, -29.0],
        [-68.0, -20.0],
        [-76.0, 0.0],
        [-78.0, 20.0],
        [-72.0, 44.0],
        [-52.0, 58.0],
        [-24.0, 62.0],
    ],
];

/// Hedges, cut to follow the ground.
pub(super) const HEDGES: &[&[[f64; 2]]] = &[
    // The churchyard.
    &[[-19.0, -26.0], [-8.0, -26.5], [4.0, -26.5], [16.0, -26.0], [24.0, -24.5]],
    &[[25.0, -6.0], [26.0, 6.0], [26.0, 18.0], [25.0, 32.0]],
    &[[12.0, 35.0], [0.0, 35.5], [-12.0, 35.0]],
    // Gardens along the village street.
    &[[-38.5, 23.0], [-37.0, 31.0], [-34.0, 40.0]],
    &[[-42.0, -57.0], [-37.5, -68.0]],
    &[[-56.0, -59.0], [-44.0, -57.5]],
    &[[-36.0, 50.0], [-30.5, 64.0]],
    &[[-17.0, 49.5], [-4.0, 50.0], [4.0, 50.0]],
    &[[5.0, 50.5], [5.0, 60.0], [5.5, 68.0]],
    &[[21.0, 50.0], [21.5, 60.0], [21.0, 68.0]],
    &[[48.0, 47.5], [54.0, 56.0], [58.0, 76.0]],
    // East.
    &[[45.0, 20.0], [45.0, 8.0], [44.0, -2.0]],
    &[[48.0, -4.0], [58.0, -4.5]],
    &[[75.0, 36.0], [73.0, 24.0], [74.5, 10.0], [76.0, -2.0], [75.5, -18.0]],
    &[[76.0, 8.0], [88.0, 9.5], [98.0, 10.0]],
    // South.
    &[[-22.0, -47.5], [-13.0, -47.5], [-4.0, -48.0]],
    &[[-2.0, -49.0], [-1.5, -60.0], [-1.0, -68.0]],
    &[[4.0, -49.5], [14.0, -49.5], [22.0, -49.5]],
    &[[24.0, -50.0], [24.0, -62.0]],
    &[[45.0, -48.0], [46.0, -62.0]],
    &[[52.0, -46.5], [62.0, -45.0], [72.0, -42.5]],
    &[[8.0, -70.0], [8.5, -82.0], [8.0, -94.0]],
    // The hillside.
    &[[-58.0, -36.0], [-60.0, -48.0]],
    &[[-76.0, -32.0], [-78.0, -46.0]],
    &[[-52.0, 25.0], [-54.0, 36.0], [-53.0, 43.0]],
    &[[-66.0, 26.0], [-68.0, 36.0]],
];

/// How a house is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Style {
    /// Two storeys, a steep roof.
    House,
    /// Two storeys, a broad low roof with deep eaves, a gable and a balcony towards the valley.
    Chalet,
    /// One tall storey.
    Barn,
}

/// A house: its middle, length along the ridge, width, direction of the ridge (degrees
/// counter-clockwise from east), style.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plot {
    pub(super) name: &'static str,
    pub(super) at: [f64; 2],
    pub(super) length_m: f64,
    pub(super) width_m: f64,
    pub(super) ridge_deg: f64,
    pub(super) style: Style,
}

const fn plot(
    name: &'static str,
    x: f64,
    y: f64,
    length: f64,
    width: f64,
    ridge: f64,
    style: Style,
) -> Plot {
    Plot { name, at: [x, y], length_m: length, width_m: width, ridge_deg: ridge, style }
}

/// The houses.
pub(super) const HOUSES: &[Plot] = &[
    // West, within 70 m of the roof: the chalet behind its trees, and the house without any.
    plot("chalet", -60.0, 10.5, 11.0, 11.5, 0.0, Style::Chalet),
    plot("open_house", -57.0, -11.5, 11.5, 9.5, 84.0, Style::House),
    // The hillside.
    plot("house_03", -49.5, -41.0, 11.0, 9.0, 62.0, Style::House),
    plot("house_04", -70.0, -40.0, 10.5, 9.0, 70.0, Style::House),
    plot("house_05", -85.0, -21.0, 12.0, 9.5, 80.0, Style::Chalet),
    plot("house_06", -88.0, 9.0, 11.0, 9.0, 92.0, Style::House),
    plot("house_07", -60.0, 36.0, 10.5, 9.0, 104.0, Style::House),
    plot("house_08", -46.0, 31.5, 9.5, 8.5, 100.0, Style::House),
    plot("house_09", -84.0, 40.0, 11.5, 9.0, 66.0, Style::Chalet),
    plot("house_10", -46.0, -66.0, 11.0, 9.0, 84.0, Style::House),
    plot("house_11", -70.0, -66.0, 14.0, 9.5, 66.0, Style::Barn),
    plot("house_12", -49.0, -88.0, 10.5, 9.0, 98.0, Style::House),
    // North.
    plot("house_13", -44.0, 74.0, 11.0, 9.0, 12.0, Style::House),
    plot("house_14", -10.0, 57.0, 11.5, 9.0, 4.0, Style::House),
    plot("house_15", 13.0, 56.5, 10.5, 9.0, 92.0, Style::House),
    plot("house_16", 37.0, 55.0, 12.0, 9.5, -22.0, Style::House),
    plot("house_17", -6.0, 80.0, 16.0, 10.0, 14.0, Style::Barn),
    plot("house_18", 26.0, 79.0, 11.0, 9.0, 96.0, Style::House),
    plot("house_19", 62.0, 66.0, 11.0, 9.0, 40.0, Style::House),
    // East.
    plot("house_20", 53.0, 9.0, 11.0, 9.0, 106.0, Style::House),
    plot("house_21", 57.5, -16.0, 10.5, 9.0, 94.0, Style::House),
    plot("house_22", 82.0, 24.0, 11.0, 9.0, 112.0, Style::House),
    plot("house_23", 83.0, -8.0, 12.0, 9.5, 86.0, Style::House),
    // South.
    plot("house_24", -13.0, -55.0, 11.0, 9.0, 2.0, Style::House),
    plot("house_25", 11.0, -57.5, 10.5, 9.0, -4.0, Style::House),
    plot("house_26", 35.0, -56.0, 12.0, 9.5, 88.0, Style::House),
    plot("house_27", 62.0, -54.0, 11.0, 9.0, 14.0, Style::House),
    plot("house_28", -4.0, -81.0, 11.0, 9.0, 88.0, Style::House),
    plot("house_29", 38.0, -82.0, 17.0, 10.0, 8.0, Style::Barn),
];

/// What grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// A round crown on a trunk.
    Broadleaf,
    /// An old one: a crown of three lobes.
    Spreading,
    /// Stacked cones.
    Conifer,
}

/// A tree: place, height, what it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planting {
    pub(super) at: [f64; 2],
    pub(super) height_m: f64,
    pub(super) kind: Kind,
}

const fn leaf(x: f64, y: f64, height: f64) -> Planting {
    Planting { at: [x, y], height_m: height, kind: Kind::Broadleaf }
}

const fn oak(x: f64, y: f64, height: f64) -> Planting {
    Planting { at: [x, y], height_m: height, kind: Kind::Spreading }
}

const fn cone(x: f64, y: f64, height: f64) -> Planting {
    Planting { at: [x, y], height_m: height, kind: Kind::Conifer }
}

/// The trees. None stands between the church and the open house.
pub(super) const TREES: &[Planting] = &[
    // Before the chalet.
    oak(-46.0, 5.5, 11.0),
    oak(-45.0, 10.0, 12.5),
    oak(-46.5, 15.0, 11.5),
    oak(-49.5, 2.5, 10.0),
    oak(-49.0, 18.5, 10.5),
    oak(-41.5, 13.5, 10.5),
    oak(-42.0, 7.0, 11.0),
    // East-southeast, adjoining the church.
    oak(31.0, -20.0, 15.0),
    oak(37.0, -24.5, 16.5),
    oak(33.0, -27.5, 15.5),
    oak(42.5, -29.5, 16.0),
    oak(39.0, -33.5, 14.0),
    oak(43.0, -22.0, 14.5),
    oak(29.5, -33.0, 13.0),
    oak(47.0, -25.5, 13.0),
    oak(36.0, -17.0, 12.5),
    // The forest's edge at the top of the hillside.
    cone(-96.0, -92.0, 15.0),
    cone(-90.0, -84.0, 13.0),
    leaf(-95.0, -75.0, 13.5),
    cone(-92.0, -64.0, 16.0),
    cone(-96.5, -55.0, 14.0),
    leaf(-92.5, -45.0, 13.0),
    cone(-97.0, -38.0, 16.5),
    leaf(-95.0, -29.0, 12.5),
    cone(-97.0, -8.0, 15.0),
    leaf(-93.5, -3.0, 12.0),
    cone(-97.0, 2.0, 16.5),
    leaf(-96.0, 17.0, 13.0),
    cone(-93.0, 23.0, 15.5),
    cone(-97.0, 29.0, 14.5),
    leaf(-95.0, 51.0, 13.5),
    cone(-90.5, 58.0, 15.5),
    cone(-96.0, 66.0, 14.0),
    leaf(-88.0, 73.0, 12.5),
    cone(-95.0, 82.0, 16.0),
    cone(-86.0, 90.0, 14.5),
    leaf(-76.0, 80.0, 12.0),
    cone(-72.0, 92.0, 13.0),
    cone(-78.0, -84.0, 14.0),
    // Gardens and streets.
    leaf(-68.0, 22.0, 8.5),
    leaf(-48.0, 46.0, 8.0),
    leaf(-70.5, 53.5, 9.0),
    leaf(-60.0, -52.0, 9.0),
    leaf(-37.0, -76.0, 8.5),
    leaf(-80.0, -50.0, 8.0),
    leaf(-22.0, 74.0, 9.5),
    leaf(2.0, 66.0, 8.0),
    leaf(25.0, 63.0, 9.0),
    leaf(47.0, 64.0, 8.5),
    leaf(42.0, 88.0, 10.0),
    cone(76.0, 84.0, 13.0),
    leaf(80.0, 48.0, 10.0),
    leaf(70.5, 33.0, 8.0),
    leaf(64.5, -3.0, 7.5),
    leaf(92.0, 8.0, 9.0),
    leaf(91.0, -24.0, 10.0),
    leaf(78.0, -52.0, 9.0),
    cone(88.0, -78.0, 14.0),
    leaf(50.0, -68.0, 8.5),
    leaf(23.0, -68.0, 8.0),
    leaf(12.0, -74.0, 9.0),
    leaf(-17.0, -68.0, 8.5),
    leaf(64.0, -88.0, 10.0),
    leaf(18.0, -92.0, 8.0),
    leaf(-17.0, -92.0, 9.5),
    // Along the street, north and south of what the roof lights.
    leaf(-21.5, 34.0, 8.0),
    leaf(14.0, 38.0, 8.5),
    leaf(24.0, 37.0, 8.0),
    leaf(34.0, 35.0, 8.5),
    leaf(-20.0, -38.0, 7.0),
    leaf(-3.0, -37.5, 7.0),
    leaf(9.0, -38.5, 7.0),
];
