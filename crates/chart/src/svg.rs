//! SVG, written element by element, and its picture.

use std::{
    fmt::Write,
    sync::{Arc, LazyLock},
};

use resvg::{
    tiny_skia::{Pixmap, Transform},
    usvg::{Options, Tree, fontdb},
};

use body_schema_palette::hex;

/// An sRGB colour.
pub type Colour = [u8; 3];

/// How text is aligned at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// Text begins at the place.
    Start,
    /// Text is centred at the place.
    Middle,
    /// Text ends at the place.
    End,
}

/// How a line is drawn: colour, width in pixels, and an SVG dash pattern, empty for a solid line.
#[derive(Clone, Copy, Debug)]
pub struct Stroke {
    /// Its colour.
    pub colour: Colour,
    /// Its width.
    pub width: f64,
    /// Its dashes.
    pub dashes: &'static str,
}

/// How text is set.
#[derive(Clone, Copy, Debug)]
pub struct Type {
    /// Size, pixels.
    pub size: f64,
    /// Bold or regular.
    pub bold: bool,
    /// Its colour.
    pub colour: Colour,
    /// Its alignment.
    pub align: Align,
}

/// A drawing in pixels, y downwards, on white.
#[derive(Debug)]
pub struct Svg {
    size: [f64; 2],
    body: String,
    clips: usize,
}

/// Pixels of the picture for each pixel of the drawing.
const ENLARGEMENT: f32 = 2.0;

/// Why a drawing could not be turned into a picture.
#[derive(Debug, thiserror::Error)]
pub enum RasterError {
    /// The drawing is not valid.
    #[error("the drawing is not valid SVG: {0}")]
    Svg(#[from] resvg::usvg::Error),
    /// The picture has no pixels, or too many.
    #[error("a picture of {0} × {1} pixels cannot be made")]
    Size(u32, u32),
    /// The picture cannot be encoded.
    #[error("cannot encode the picture: {0}")]
    Encode(String),
}

impl Svg {
    /// An empty drawing of this width and height.
    pub fn new(width: f64, height: f64) -> Self {
        Self { size: [width, height], body: String::new(), clips: 0 }
    }

    fn push(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = self.body.write_fmt(element);
        self.body.push('\n');
    }

    /// A line through points.
    pub fn line(&mut self, points: &[[f64; 2]], stroke: Stroke) {
        let (colour, width) = (hex(stroke.colour), stroke.width);
        let dashes =
            if stroke.dashes.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{}\"", stroke.dashes) };
        let points = list(points);
        self.push(format_args!(
            "<polyline points=\"{points}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" \
             stroke-linejoin=\"round\"{dashes}/>"
        ));
    }

    /// A filled area without an outline.
    pub fn area(&mut self, points: &[[f64; 2]], fill: Colour, opacity: f64) {
        let (points, fill) = (list(points), hex(fill));
        self.push(format_args!("<polygon points=\"{points}\" fill=\"{fill}\" fill-opacity=\"{opacity}\"/>"));
    }

    /// A closed outline, filled.
    pub fn shape(&mut self, points: &[[f64; 2]], fill: Colour, outline: Stroke) {
        let (points, fill, colour, width) = (list(points), hex(fill), hex(outline.colour), outline.width);
        self.push(format_args!(
            "<polygon points=\"{points}\" fill=\"{fill}\" stroke=\"{colour}\" stroke-width=\"{width}\"/>"
        ));
    }

    /// A filled disc with an outline.
    pub fn disc(&mut self, [x, y]: [f64; 2], radius: f64, fill: Colour, outline: Stroke) {
        let (fill, colour, width) = (hex(fill), hex(outline.colour), outline.width);
        self.push(format_args!(
            "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"{colour}\" \
             stroke-width=\"{width}\"/>"
        ));
    }

    /// Text with its baseline at a place, turned anticlockwise by so many degrees.
    pub fn text(&mut self, [x, y]: [f64; 2], text: &str, face: Type, turned_deg: f64) {
        let anchor = match face.align {
            Align::Start => "start",
            Align::Middle => "middle",
            Align::End => "end",
        };
        let weight = if face.bold { " font-weight=\"bold\"" } else { "" };
        let turn =
            if turned_deg == 0.0 { String::new() } else { format!(" transform=\"rotate({} {x} {y})\"", -turned_deg) };
        let (size, colour, text) = (face.size, hex(face.colour), escaped(text));
        self.push(format_args!(
            "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{size}\"{weight} fill=\"{colour}\" \
             text-anchor=\"{anchor}\"{turn}>{text}</text>"
        ));
    }

    /// Draws with `draw`, clipped to a rectangle.
    pub fn clipped(&mut self, [left, top, width, height]: [f64; 4], draw: impl FnOnce(&mut Self)) {
        self.clips += 1;
        let id = self.clips;
        self.push(format_args!(
            "<clipPath id=\"clip{id}\"><rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\"/></clipPath>\n\
             <g clip-path=\"url(#clip{id})\">"
        ));
        draw(self);
        self.push(format_args!("</g>"));
    }

    /// The whole document. `description` is for readers who cannot see it.
    pub fn finish(&self, description: &str) -> String {
        let [width, height] = self.size;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" font-family=\"DejaVu Sans, Verdana, sans-serif\" role=\"img\">\n<title>{}</title>\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n{}</svg>\n",
            escaped(description),
            self.body
        )
    }
}

/// The picture of a drawing as PNG, with built-in fonts, so that it is the same on every machine.
///
/// # Errors
///
/// [`RasterError::Svg`] if the text is no valid SVG, [`RasterError::Size`] if the picture has no pixels or too many,
/// [`RasterError::Encode`] if PNG cannot hold it.
pub fn png(svg: &str) -> Result<Vec<u8>, RasterError> {
    static FONTS: LazyLock<Arc<fontdb::Database>> = LazyLock::new(|| {
        let mut fonts = fontdb::Database::new();
        fonts.load_font_data(dejavu::sans::regular().to_vec());
        fonts.load_font_data(dejavu::sans::bold().to_vec());
        Arc::new(fonts)
    });
    let options = Options { fontdb: FONTS.clone(), font_family: "DejaVu Sans".to_owned(), ..Options::default() };
    let tree = Tree::from_str(svg, &options)?;
    let [width, height] =
        [tree.size().width(), tree.size().height()].map(|pixels| (pixels * ENLARGEMENT).ceil() as u32);
    let mut picture = Pixmap::new(width, height).ok_or(RasterError::Size(width, height))?;
    resvg::render(&tree, Transform::from_scale(ENLARGEMENT, ENLARGEMENT), &mut picture.as_mut());
    picture.encode_png().map_err(|error| RasterError::Encode(error.to_string()))
}

fn list(points: &[[f64; 2]]) -> String {
    points.iter().map(|[x, y]| format!("{x:.2},{y:.2}")).collect::<Vec<_>>().join(" ")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
