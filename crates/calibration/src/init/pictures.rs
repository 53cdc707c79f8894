//! The sizes of the pictures in which a table's points lie.

use super::columns::Sensor;
use body_schema_table::{Columns, Table, TableError};

/// A camera, with the width and height of its picture, pixels.
pub type Picture = (String, [u32; 2]);

/// Common sizes of pictures, pixels.
const COMMON: [[u32; 2]; 7] =
    [[640, 480], [848, 480], [1280, 720], [1280, 1024], [1920, 1080], [2448, 2048], [4096, 3072]];

/// For each camera the smallest common size that holds all of its points, or a size that just does, if no common one is
/// large enough.
///
/// # Errors
///
/// [`TableError`] if a row cannot be read.
pub fn sizes(sensors: &[Sensor], table: &str) -> Result<Vec<Picture>, TableError> {
    let seen: Vec<(&String, &Sensor)> = sensors.iter().filter_map(|it| Some((it.camera.as_ref()?, it))).collect();
    let mut extents: Vec<(String, [f64; 2])> = Vec::new();
    for (camera, _) in &seen {
        if !extents.iter().any(|(known, _)| known == *camera) {
            extents.push(((*camera).clone(), [0.0; 2]));
        }
    }
    if seen.is_empty() {
        return Ok(Vec::new());
    }
    let table = Table::open(table.as_bytes())?;
    let titled = |(_, sensor): &(&String, &Sensor)| table.titles().reading_titled(sensor.layout(), &sensor.columns);
    let readings = seen.iter().map(titled).collect::<Result<Vec<_>, _>>()?;
    for row in table.rows(Columns { readings, ..Columns::default() }) {
        for ((camera, _), reading) in seen.iter().zip(&row?.observation.readings) {
            let (Some(reading), Some((_, extent))) = (reading, extents.iter_mut().find(|(known, _)| known == *camera))
            else {
                continue;
            };
            extent.iter_mut().zip(reading).for_each(|(extent, at)| *extent = extent.max(*at));
        }
    }
    Ok(extents.into_iter().map(|(camera, extent)| (camera, size(extent))).collect())
}

/// The size that holds points up to `extent`.
fn size(extent: [f64; 2]) -> [u32; 2] {
    let holds = |size: &&[u32; 2]| size.iter().zip(extent).all(|(size, extent)| extent <= f64::from(*size));
    COMMON.iter().find(holds).copied().unwrap_or_else(|| extent.map(|extent| extent.ceil().max(1.0) as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_hold_their_points() {
        for (extent, expected) in [
            ([500.0, 300.5], [640, 480]),
            ([641.0, 100.0], [848, 480]),
            ([1300.0, 900.0], [1920, 1080]),
            ([9000.2, 10.0], [9001, 10]),
        ] {
            assert_eq!(size(extent), expected);
        }
    }
}
