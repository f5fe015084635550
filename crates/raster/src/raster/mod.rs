//! SVG pictures as pixels, as PNG files and as looping GIF files.
//!
//! The text has the font DejaVu Sans Condensed, which the program contains. Fonts of the
//! machine are never read, so one build gives the same bytes on every machine.

mod looping;

use std::sync::{Arc, LazyLock};

use resvg::tiny_skia::{Color, Pixmap, Transform};
use resvg::usvg::fontdb::{Database, Source};
use resvg::usvg::{Options, Tree};

pub use looping::{GifFrame, MOST_GIF_BYTES, looping_gif};

/// Longest side of an image in pixels.
const MOST_PX: f32 = 16_384.0;

/// A picture cannot become pixels.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RasterError {
    /// The text is no SVG.
    #[error("the picture cannot be read: {why}")]
    Svg {
        /// The reason.
        why: String,
    },
    /// The image would have no pixel, or too many.
    #[error("an image of {width_px:.0} × {height_px:.0} pixels cannot be drawn")]
    Size {
        /// Width in pixels.
        width_px: f32,
        /// Height in pixels.
        height_px: f32,
    },
    /// The image does not fit the file format.
    #[error("the image cannot be encoded: {why}")]
    Encoding {
        /// The reason.
        why: String,
    },
}

/// Pixels of a picture, row by row from the top.
pub struct PixelImage {
    pixels: Pixmap,
}

/// Fonts of all text: the two faces that the program contains.
static FONTS: LazyLock<Arc<Database>> = LazyLock::new(|| {
    let mut fonts = Database::new();
    let faces: [&'static [u8]; 2] = [
        dejavu::sans_condensed::regular(),
        dejavu::sans_condensed::bold(),
    ];
    for face in faces {
        fonts.load_font_source(Source::Binary(Arc::new(face)));
    }
    let family = fonts.faces().next().and_then(|it| it.families.first());
    // Pictures ask for `sans-serif`, and no face of that name exists without this line.
    if let Some((family, _)) = family.cloned() {
        fonts.set_sans_serif_family(family);
    }
    Arc::new(fonts)
});

impl PixelImage {
    /// Draws an SVG with `scale` pixels per unit of it, without animations.
    ///
    /// # Errors
    /// The text is no SVG, or the image has no pixel or a side above 16,384 pixels.
    ///
    /// ```
    /// # use brakecheck_raster as brakecheck;
    /// use brakecheck::raster::PixelImage;
    /// let svg = "<svg xmlns='http://www.w3.org/2000/svg' width='8' height='4'/>";
    /// let image = PixelImage::of(svg, 2.0)?;
    /// assert_eq!((image.width_px(), image.height_px()), (16, 8));
    /// assert!(image.png()?.starts_with(b"\x89PNG"));
    /// # Ok::<(), brakecheck::raster::RasterError>(())
    /// ```
    pub fn of(svg: &str, scale: f32) -> Result<PixelImage, RasterError> {
        let options = Options {
            font_family: "sans-serif".to_owned(),
            fontdb: Arc::clone(&FONTS),
            ..Options::default()
        };
        let tree = Tree::from_str(svg, &options).map_err(|error| RasterError::Svg {
            why: error.to_string(),
        })?;
        let size = tree.size();
        let (width_px, height_px) = (scale * size.width(), scale * size.height());
        let wrong = RasterError::Size {
            width_px,
            height_px,
        };
        // Written so that a size that is no number is refused, too.
        if !(width_px <= MOST_PX && height_px <= MOST_PX) {
            return Err(wrong);
        }
        // Both are at most `MOST_PX`.
        let (columns, rows) = (width_px.round() as u32, height_px.round() as u32);
        let mut pixels = Pixmap::new(columns, rows).ok_or(wrong)?;
        let transform = Transform::from_scale(scale, scale);
        resvg::render(&tree, transform, &mut pixels.as_mut());
        Ok(PixelImage { pixels })
    }

    /// Returns the width in pixels.
    pub fn width_px(&self) -> usize {
        self.pixels.width() as usize
    }

    /// Returns the height in pixels.
    pub fn height_px(&self) -> usize {
        self.pixels.height() as usize
    }

    /// Returns a PNG file, which is transparent where the picture is.
    ///
    /// # Errors
    /// The encoder refuses the image.
    pub fn png(&self) -> Result<Vec<u8>, RasterError> {
        self.pixels
            .encode_png()
            .map_err(|error| RasterError::Encoding {
                why: error.to_string(),
            })
    }

    /// Returns red, green and blue of every pixel, `[height, width, 3]`, on white.
    pub fn rgb(&self) -> Vec<u8> {
        let white = Color::WHITE.premultiply().to_color_u8();
        // Colours are premultiplied, so white shows through by the missing share.
        let on_white = |part: u8, alpha: u8| part.saturating_add(white.alpha() - alpha);
        let pixels = self.pixels.pixels().iter();
        pixels
            .flat_map(|it| [it.red(), it.green(), it.blue()].map(|part| on_white(part, it.alpha())))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(inside: &str) -> Vec<u8> {
        let svg = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' width='60' height='20'><style>svg{{font: 13px system-ui, sans-serif}}.b{{font-weight: 700}}</style>{inside}</svg>"
        );
        PixelImage::of(&svg, 1.0).expect("an image").rgb()
    }

    fn ink(rgb: &[u8]) -> u32 {
        rgb.iter().map(|part| u32::from(255 - part)).sum()
    }

    #[test]
    fn text_is_drawn_without_fonts_of_the_machine() {
        let empty = drawn("");
        assert_eq!((empty.len(), ink(&empty)), (60 * 20 * 3, 0));
        for text in ["ego", "−3 m/s²", "◀▶▲▼", "ρ Δ “”"] {
            let plain = ink(&drawn(&format!("<text y='15'>{text}</text>")));
            let bold = ink(&drawn(&format!("<text class='b' y='15'>{text}</text>")));
            assert!(plain > 1000 && bold >= plain, "{text}: {plain}, {bold}");
            // Signs are equal in both faces, and letters are not.
            assert_eq!(bold == plain, text == "◀▶▲▼", "{text}");
        }
    }

    #[test]
    fn a_transparent_place_is_white() {
        let rgb = drawn("<rect width='30' height='20' fill-opacity='0.5'/>");
        assert!((127..=128).contains(&rgb[0]), "{}", rgb[0]);
        assert_eq!(rgb[59 * 3], 255);
    }

    #[test]
    fn what_is_no_picture_is_refused() {
        let of = |svg: &str, scale| PixelImage::of(svg, scale).err().map(|it| it.to_string());
        let broken = of("<svg", 1.0).expect("an error");
        assert!(broken.starts_with("the picture cannot be read"), "{broken}");
        let svg = "<svg xmlns='http://www.w3.org/2000/svg' width='9000' height='4'/>";
        let large = of(svg, 2.0).expect("an error");
        assert!(large.contains("18000 × 8 pixels"), "{large}");
        assert!(of(svg, 0.0).is_some() && of(svg, f32::NAN).is_some());
    }
}
