//! The built-in table: sizes that are commonly in stock, after the European standards named below.

use crate::{Profile, Shape};

/// EN 10060, hot rolled round bars: diameters.
const ROUND: [f64; 46] = [
    1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0, 15.0, 16.0, 18.0, 20.0, 22.0,
    24.0, 25.0, 28.0, 30.0, 32.0, 35.0, 36.0, 40.0, 45.0, 50.0, 55.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0,
    90.0, 95.0, 100.0, 110.0, 120.0, 130.0, 140.0, 150.0, 180.0, 200.0,
];
/// EN 10059, square bars: sides.
const SQUARE: [f64; 26] = [
    3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 14.0, 15.0, 16.0, 18.0, 20.0, 22.0, 25.0, 28.0, 30.0, 32.0, 35.0,
    40.0, 45.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0,
];
/// EN 10305-1 (up to 30 mm) and EN 10220, tubes: outer diameter, wall.
const TUBE: [[f64; 2]; 38] = [
    [4.0, 0.5],
    [5.0, 1.0],
    [6.0, 1.0],
    [6.0, 1.5],
    [8.0, 1.0],
    [8.0, 2.0],
    [10.0, 1.0],
    [10.0, 2.0],
    [12.0, 1.0],
    [12.0, 2.0],
    [14.0, 2.0],
    [15.0, 1.5],
    [16.0, 2.0],
    [18.0, 1.5],
    [20.0, 2.0],
    [20.0, 3.0],
    [22.0, 2.0],
    [25.0, 2.0],
    [25.0, 3.0],
    [28.0, 2.0],
    [30.0, 2.5],
    [30.0, 4.0],
    [33.7, 2.6],
    [33.7, 4.0],
    [42.4, 2.6],
    [42.4, 4.0],
    [48.3, 2.6],
    [48.3, 5.0],
    [60.3, 2.9],
    [60.3, 5.0],
    [76.1, 2.9],
    [76.1, 6.3],
    [88.9, 3.2],
    [88.9, 6.3],
    [114.3, 3.6],
    [114.3, 8.0],
    [139.7, 4.0],
    [168.3, 4.5],
];
/// EN 10219, cold formed square hollow sections: side, wall.
const SQUARE_HOLLOW: [[f64; 2]; 20] = [
    [10.0, 1.0],
    [12.0, 1.5],
    [15.0, 1.5],
    [20.0, 2.0],
    [25.0, 2.0],
    [30.0, 2.0],
    [30.0, 3.0],
    [40.0, 3.0],
    [40.0, 4.0],
    [50.0, 3.0],
    [50.0, 5.0],
    [60.0, 3.0],
    [60.0, 5.0],
    [80.0, 4.0],
    [80.0, 6.0],
    [100.0, 4.0],
    [100.0, 8.0],
    [120.0, 5.0],
    [150.0, 6.0],
    [200.0, 8.0],
];
/// EN 10219, cold formed rectangular hollow sections: height, width, wall.
const RECTANGULAR_HOLLOW: [[f64; 3]; 16] = [
    [20.0, 10.0, 1.5],
    [30.0, 15.0, 1.5],
    [30.0, 20.0, 2.0],
    [40.0, 20.0, 2.0],
    [40.0, 30.0, 3.0],
    [50.0, 25.0, 2.5],
    [50.0, 30.0, 3.0],
    [60.0, 40.0, 3.0],
    [60.0, 40.0, 4.0],
    [80.0, 40.0, 4.0],
    [80.0, 60.0, 4.0],
    [100.0, 50.0, 4.0],
    [100.0, 60.0, 5.0],
    [120.0, 60.0, 5.0],
    [150.0, 100.0, 6.0],
    [200.0, 100.0, 8.0],
];
/// EN 10365, IPE: height, width, web, flange.
const IPE: [[f64; 4]; 12] = [
    [80.0, 46.0, 3.8, 5.2],
    [100.0, 55.0, 4.1, 5.7],
    [120.0, 64.0, 4.4, 6.3],
    [140.0, 73.0, 4.7, 6.9],
    [160.0, 82.0, 5.0, 7.4],
    [180.0, 91.0, 5.3, 8.0],
    [200.0, 100.0, 5.6, 8.5],
    [220.0, 110.0, 5.9, 9.2],
    [240.0, 120.0, 6.2, 9.8],
    [270.0, 135.0, 6.6, 10.2],
    [300.0, 150.0, 7.1, 10.7],
    [360.0, 170.0, 8.0, 12.7],
];

/// All built-in profiles, solid ones first.
pub fn standard() -> Vec<Profile> {
    let profile =
        |name: String, shape, dimensions: &[f64]| Profile { name, shape, dimensions: dimensions.to_vec() };
    let mut table: Vec<_> =
        ROUND.iter().map(|&d| profile(format!("round {d}"), Shape::Round, &[d])).collect();
    table.extend(SQUARE.iter().map(|&a| profile(format!("square {a}"), Shape::Square, &[a])));
    table.extend(TUBE.iter().map(|s| profile(format!("tube {} x {}", s[0], s[1]), Shape::Tube, s)));
    table.extend(
        SQUARE_HOLLOW.iter().map(|s| profile(format!("SHS {} x {}", s[0], s[1]), Shape::SquareHollow, s)),
    );
    table.extend(
        (RECTANGULAR_HOLLOW.iter())
            .map(|s| profile(format!("RHS {} x {} x {}", s[0], s[1], s[2]), Shape::RectangularHollow, s)),
    );
    table.extend(IPE.iter().map(|s| profile(format!("IPE {}", s[0]), Shape::I, s)));
    table
}
