//! The text of the calibration file.

use super::{Guess, Sources, carriers::Carriers, columns::Sensor, named::BALL, pictures::Picture};
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
    (chain, carriers, coupled): (&Chain, &Carriers, &[(String, String)]),
    (sensors, pictures): (&[Sensor], &[Picture]),
    sockets: Option<&Sockets<'_>>,
    guesses: &[Guess],
) -> String {
    let Sources { name, urdf_file, shapes_file, table_file, .. } = sources;
    let mut text = format!("# Calibration of {name}: body-schema calibrate\n#\n# Guessed, to be looked over:\n");
    guesses.iter().for_each(|guess| text.push_str(&format!("#   {guess}\n")));
    text.push_str(&format!("\nname = {}\n\n[robot]\nurdf = {}\n", quoted(name), quoted(urdf_file)));
    for file in shapes_file.iter() {
        text.push_str(&format!("shapes = {}\n", quoted(file)));
    }
    text.push_str(&match carriers.is_empty() {
        true => format!(
            "# The link that stands still, and the one that carries the targets.\nbase = {}\ntip = {}\n",
            quoted(&chain.base),
            quoted(chain.tip())
        ),
        false => format!(
            "# The link that stands still; all joints between it and those of targets and cameras are in.\nbase = {}\n",
            quoted(&chain.base)
        ),
    });
    text.push_str("# Joints that are right as they are described: hold = [\"…\"]\n");
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
            text.push_str(&target(sensor, carriers.link(&sensor.name, false)));
        }
        text.push_str(&measures(sensor));
    }
    for (camera, [width, height]) in pictures {
        let link = carriers.link(camera, true).map(|link| format!("link = {}\n", quoted(link))).unwrap_or_default();
        let (said, place) = match carriers.looks(camera) {
            Some(rpy_deg) => (
                "Where it is in the frame of its link, looking along z, x to the right of the picture: it is found, to so much.",
                format!("at_m = [0.0, 0.0, 0.0]\nrpy_deg = {rpy_deg:?}\nknown = {{ to_m = 0.05, to_deg = 10.0 }}"),
            ),
            None if link.is_empty() => (
                "Where it stands is found. Who knows it writes at_m = [x, y, z] and looks_at_m = [x, y, z], in the frame of the base.",
                "known = \"unknown\"".to_owned(),
            ),
            None => (
                "Where it is on its link is found. Who knows it writes at_m = [x, y, z] and rpy_deg = [roll, pitch, yaw], looking along z.",
                "known = \"unknown\"".to_owned(),
            ),
        };
        text.push_str(&format!(
            "\n# {said}\n[[camera]]\nname = {}\n{link}{place}\nsize_px = [{width}.0, {height}.0]\nfocal_px = [{width}.0, {width}.0]\n\
             # Focal lengths are guessed here. They and the centre are found too, to so many pixels: known_to_px = 5.0\n",
            quoted(camera)
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
            "\n[[target]]\nname = \"ball\"\n{}\n# The ball is put into sockets, and nothing but joints is measured.\n[sockets]\n\
             place_column = {}\nsocket_column = {}\n# Play, and what the joints' readings scatter, at the ball.\nsigma_m = 0.0002\n{distance}",
            on(carriers.link(BALL, false)),
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

/// The line of the link of a target, if that is not the tip.
fn on(link: Option<&str>) -> String {
    link.map_or_else(String::new, |link| format!("link = {}\n", quoted(link)))
}

/// The keys of the target of a sensor, as text; `link` carries it, if that is not the tip.
fn target(sensor: &Sensor, link: Option<&str>) -> String {
    let name = quoted(&sensor.name);
    let on = on(link);
    let frame = if link.is_some() { "its link" } else { "the tip" };
    match sensor.side_m {
        None => format!(
            "\n# Where it is on {frame} is found, to 0.3 m; say what is known by at_m and known = {{ to_m = … }}.\n[[target]]\nname = {name}\n{on}"
        ),
        Some(side_m) => {
            let half = 0.5 * side_m;
            let corners = [[-half, half], [half, half], [half, -half], [-half, -half]];
            let corners: Vec<String> = corners.iter().map(|[x, y]| format!("[{x}, {y}, 0.0]")).collect();
            format!(
                "\n# A square tag, its corners from the top left one on, clockwise as one looks at it: x to the right, y up, z out of the \
                 print.\n# Where it is on {frame}, and how it is turned, is found.\n[[target]]\nname = {name}\n{on}at_m = [0.0, 0.0, 0.0]\nrpy_deg \
                 = [0.0, 0.0, 0.0]\npoints_m = [{}]\nfacing = [0.0, 0.0, 1.0]\nfacing_within_deg = 80.0\nknown = {{ anywhere_m = 0.3 }}\n",
                corners.join(", ")
            )
        }
    }
}

/// The keys of a sensor, as text.
fn measures(sensor: &Sensor) -> String {
    let Sensor { name, channel, camera, columns, sigmas, .. } = sensor;
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
