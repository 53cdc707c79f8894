//! The text of the calibration file.

use super::{Guess, Sources, columns::Sensor, pictures::Picture};
use body_schema_robot::Chain;

/// The sockets, as the file describes them.
pub struct Sockets<'a> {
    /// The columns of place and socket.
    pub columns: &'a (String, String),
    /// The place whose rows are learned from, where there are several.
    pub trained: Option<&'a str>,
    /// The distance between the two sockets of a place, metres.
    pub distance_m: Option<f64>,
}

/// The text of the file.
pub fn written(
    sources: &Sources<'_>,
    (chain, coupled): (&Chain, &[(String, String)]),
    (sensors, pictures): (&[Sensor], &[Picture]),
    sockets: Option<&Sockets<'_>>,
    guesses: &[Guess],
) -> String {
    let Sources { name, urdf_file, table_file, .. } = sources;
    let mut text = format!("# Calibration of {name}: body-schema calibrate\n#\n# Guessed, to be looked over:\n");
    guesses.iter().for_each(|guess| text.push_str(&format!("#   {guess}\n")));
    text.push_str(&format!(
        "\nname = {}\n\n[robot]\nurdf = {}\n# The link that stands still, and the one that carries the targets.\nbase = {}\ntip = {}\n\
         # Joints that are right as they are described: hold = [\"…\"]\n",
        quoted(name),
        quoted(urdf_file),
        quoted(&chain.base),
        quoted(chain.tip())
    ));
    if !coupled.is_empty() {
        text.push_str(
            "# Joints that no motor turns by itself, each with the sum of others that it follows.\n[robot.coupled]\n",
        );
        coupled.iter().for_each(|(joint, sum)| text.push_str(&format!("{} = {}\n", quoted(joint), quoted(sum))));
    }
    let mut named: Vec<&str> = Vec::new();
    for sensor in sensors {
        if !named.contains(&sensor.name.as_str()) {
            named.push(&sensor.name);
            text.push_str(&format!(
                "\n# Where it is on the tip is found, to 0.3 m; say what is known by at_m and known = {{ to_m = … }}.\n[[target]]\n\
                 name = {}\n",
                quoted(&sensor.name)
            ));
        }
        text.push_str(&measures(sensor));
    }
    for (name, [width, height]) in pictures {
        text.push_str(&format!(
            "\n# Write where it stands, in the frame of the base, the point that it looks at, and its focal lengths. What is here \
             is guessed.\n[[camera]]\nname = {}\nat_m = [1.5, 0.0, 0.5]\nlooks_at_m = [0.0, 0.0, 0.5]\n\
             # It is found, to so much.\nknown = {{ to_m = 0.5, to_deg = 30.0 }}\n\
             size_px = [{width}.0, {height}.0]\nfocal_px = [{width}.0, {width}.0]\n\
             # Focal lengths and centre are found too, to so many pixels: known_to_px = 5.0\n",
            quoted(name)
        ));
    }
    if let Some(Sockets { columns: (place, socket), distance_m, .. }) = sockets {
        let distance = match distance_m {
            Some(metres) => format!(
                "# How far the two sockets of one place are apart, and how well that is known: it tells how large the robot is.\n\
                 distance_m = {metres:?}\nsigma_distance_m = 0.0001\n"
            ),
            None => "# MISSING, see above: how far the two sockets of one place are apart. Nothing else tells how large the robot is.\n\
                     # distance_m =\n# sigma_distance_m = 0.0001\n"
                .to_owned(),
        };
        text.push_str(&format!(
            "\n[[target]]\nname = \"ball\"\n\n# The ball is put into sockets, and nothing but joints is measured.\n[sockets]\n\
             place_column = {}\nsocket_column = {}\n# Play, and what the joints' readings scatter, at the ball.\nsigma_m = 0.0002\n{distance}",
            quoted(place),
            quoted(socket)
        ));
    }
    text.push_str(&format!("\n[measurements]\nfile = {}\n\n", quoted(table_file)));
    text.push_str("# What nothing is learned from: it says how good the calibration is on data that it has not seen.\n[held_out]\n");
    match sockets {
        Some(Sockets { columns: (place, _), trained: Some(trained), .. }) => {
            text.push_str(&format!("by = {}\ntrain = [{}]\n", quoted(place), quoted(trained)));
        }
        _ => text.push_str("folds = 5\n"),
    }
    text.push_str("\n# How well each joint is known in the frame before it: about half a degree and a few millimetres. Its scale is learned.\n[prior]\ndirection_rad = 0.01\npoint_m = 0.005\n");
    text
}

/// The keys of a sensor, as text.
fn measures(sensor: &Sensor) -> String {
    let Sensor { name, channel, camera, columns, sigmas } = sensor;
    let camera = camera.as_ref().map(|camera| format!("camera = {}\n", quoted(camera))).unwrap_or_default();
    let to = match *channel {
        "distance" => {
            "# The fixed point from which it is measured, in the frame of the measurements: its origin, unless it is known.\n\
                       to_m = [0.0, 0.0, 0.0]\n"
        }
        _ => "",
    };
    format!(
        "\n[[sensor]]\nchannel = {}\n{camera}target = {}\ncolumns = [{}]\n{to}# What its maker promises; how much noise there is, is \
         learned.\n{sigmas}",
        quoted(channel),
        quoted(name),
        columns.iter().map(|column| quoted(column)).collect::<Vec<_>>().join(", "),
    )
}

/// A string as TOML writes it.
fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}
