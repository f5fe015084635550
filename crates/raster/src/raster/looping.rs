//! Looping GIF files of frames with few colours.

use std::borrow::Cow;
use std::collections::BTreeMap;

use gif::{DisposalMethod, Encoder, Frame, Repeat};

use super::{PixelImage, RasterError};

/// Greatest size of a file in bytes. A longer film shows fewer frames per second.
pub const MOST_GIF_BYTES: usize = 2_000_000;

/// Colours of a palette, without that of a pixel which stays.
const COLOURS: usize = 255;
/// Index of a pixel that stays as in the frame before.
const STAYS: u8 = 255;
/// Most frequent colours, which the palette has exactly.
const EXACT: usize = 96;
/// Least distances between further colours, which are tried in turn.
const APART: [i32; 5] = [28, 18, 10, 5, 1];

/// Frame of a film.
pub struct GifFrame {
    /// The image. All images of a film have one size.
    pub image: PixelImage,
    /// Duration in seconds, which the file rounds to 0.01 s.
    pub duration_s: f64,
}

type Rgb = [u8; 3];

/// Frame as indices of the palette.
struct IndexedFrame {
    indices: Vec<u8>,
    hundredths: u16,
}

/// Returns a GIF file that plays the frames in an endless loop.
///
/// All frames share a palette of 255 colours. A file above [`MOST_GIF_BYTES`] is
/// written again with every second frame, which is shown twice as long.
///
/// # Errors
/// There is no frame, the frames differ in size, or a side is longer than 65,535 pixels.
pub fn looping_gif(
    frames: impl IntoIterator<Item = Result<GifFrame, RasterError>>,
) -> Result<Vec<u8>, RasterError> {
    let mut size_px = None;
    let mut colours: Vec<(Vec<Rgb>, u16)> = Vec::new();
    for frame in frames {
        let GifFrame { image, duration_s } = frame?;
        let own_px = [image.width_px(), image.height_px()];
        if *size_px.get_or_insert(own_px) != own_px {
            return Err(refused("its frames differ in size"));
        }
        let rgb = image.rgb();
        let pixels = rgb.chunks_exact(3).map(|it| [it[0], it[1], it[2]]);
        // Browsers take a duration of 0 for 0.1 s, and the format has 16 bits.
        let hundredths = (100.0 * duration_s).round().clamp(1.0, 65_535.0) as u16;
        colours.push((pixels.collect(), hundredths));
    }
    let Some(size_px) = size_px else {
        return Err(refused("it has no frame"));
    };
    // One palette for all frames, because a palette per frame flickers and takes 768
    // bytes each.
    let palette = palette(colours.iter().flat_map(|(pixels, _)| pixels));
    // Anti-aliased edges repeat the same colours in all frames, so each is looked up
    // once.
    let mut nearest = BTreeMap::new();
    let indexed = colours.into_iter().map(|(pixels, hundredths)| {
        let index = |rgb: &Rgb| {
            *nearest
                .entry(*rgb)
                .or_insert_with(|| nearest_of(*rgb, &palette))
        };
        IndexedFrame {
            indices: pixels.iter().map(index).collect(),
            hundredths,
        }
    });
    let mut shown: Vec<IndexedFrame> = indexed.collect();
    loop {
        let file = encoded(size_px, &palette, &shown)?;
        // Two frames cannot be halved without losing the begin or the end.
        if file.len() <= MOST_GIF_BYTES || shown.len() < 3 {
            return Ok(file);
        }
        shown = halved(shown);
    }
}

fn refused(why: &str) -> RasterError {
    RasterError::Encoding {
        why: why.to_owned(),
    }
}

/// Returns the palette: the most frequent colours, then frequent ones that differ from them.
fn palette<'a>(pixels: impl Iterator<Item = &'a Rgb>) -> Vec<Rgb> {
    // Ordered, since the iteration order of a hash map would change the bytes of the
    // file.
    let mut counts: BTreeMap<Rgb, usize> = BTreeMap::new();
    for rgb in pixels {
        *counts.entry(*rgb).or_default() += 1;
    }
    let mut frequent: Vec<(Rgb, usize)> = counts.into_iter().collect();
    // The sort is stable, so equal counts stay in the order of the colours.
    frequent.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let mut palette: Vec<Rgb> = frequent.iter().take(EXACT).map(|(rgb, _)| *rgb).collect();
    // From large to small distances, so that rare but distinct colours come before
    // shades.
    for apart in APART {
        for (rgb, _) in &frequent {
            let is_new = |known: &Rgb| distance_of(*rgb, *known) >= apart * apart;
            if palette.len() < COLOURS && palette.iter().all(is_new) {
                palette.push(*rgb);
            }
        }
    }
    palette
}

/// Square of the distance of two colours.
fn distance_of(one: Rgb, other: Rgb) -> i32 {
    let parts = one.iter().zip(&other);
    parts
        .map(|(a, b)| {
            let apart = i32::from(*a) - i32::from(*b);
            apart * apart
        })
        .sum()
}

/// Returns the index of the most similar colour.
fn nearest_of(rgb: Rgb, palette: &[Rgb]) -> u8 {
    // The zip ends with the palette, so the index of staying pixels is never chosen.
    let nearest = (0..=STAYS)
        .zip(palette)
        .min_by_key(|(_, known)| distance_of(rgb, **known));
    nearest.map_or(0, |(index, _)| index)
}

/// Returns every second frame, each with its duration and the next one's.
///
/// The last frame is always kept, because it shows the end.
fn halved(frames: Vec<IndexedFrame>) -> Vec<IndexedFrame> {
    let last = frames.len() - 1;
    let mut kept: Vec<IndexedFrame> = Vec::new();
    for (nth, frame) in frames.into_iter().enumerate() {
        match kept.last_mut() {
            Some(before) if nth % 2 == 1 && nth < last => {
                before.hundredths = before.hundredths.saturating_add(frame.hundredths);
            }
            _ => kept.push(frame),
        }
    }
    kept
}

/// Writes the file. A frame after the first has only the rectangle that changes.
fn encoded(
    size_px: [usize; 2],
    palette: &[Rgb],
    frames: &[IndexedFrame],
) -> Result<Vec<u8>, RasterError> {
    let side =
        |px: usize| u16::try_from(px).map_err(|_| refused("a side is longer than 65,535 pixels"));
    let (width, height) = (side(size_px[0])?, side(size_px[1])?);
    let mut colours = palette.concat();
    // The colour of pixels that stay is the last of 256.
    colours.resize(3 * 256, 0);
    let failed = |error: gif::EncodingError| refused(&error.to_string());
    let mut encoder = Encoder::new(Vec::new(), width, height, &colours).map_err(failed)?;
    encoder.set_repeat(Repeat::Infinite).map_err(failed)?;
    let mut before: Option<&IndexedFrame> = None;
    for frame in frames {
        let [left, top, wide, high] = changed(before, frame, size_px[0]);
        let mut buffer = Vec::with_capacity(wide * high);
        for row in top..top + high {
            let from = row * size_px[0] + left;
            let now = &frame.indices[from..from + wide];
            match before {
                None => buffer.extend_from_slice(now),
                Some(before) => {
                    let then = &before.indices[from..from + wide];
                    let pairs = now.iter().zip(then);
                    buffer.extend(pairs.map(|(now, then)| if now == then { STAYS } else { *now }));
                }
            }
        }
        let written = Frame {
            delay: frame.hundredths,
            // Pixels that stay are transparent, so the frame before must remain below
            // them.
            dispose: DisposalMethod::Keep,
            transparent: Some(STAYS),
            left: side(left)?,
            top: side(top)?,
            width: side(wide)?,
            height: side(high)?,
            buffer: Cow::Owned(buffer),
            ..Frame::default()
        };
        encoder.write_frame(&written).map_err(failed)?;
        before = Some(frame);
    }
    encoder
        .into_inner()
        .map_err(|error| refused(&error.to_string()))
}

/// Returns left, top, width and height of the rectangle that changes, of one pixel at least.
fn changed(before: Option<&IndexedFrame>, frame: &IndexedFrame, width: usize) -> [usize; 4] {
    let height = frame.indices.len() / width;
    let Some(before) = before else {
        return [0, 0, width, height];
    };
    let rows = frame
        .indices
        .chunks_exact(width)
        .zip(before.indices.chunks_exact(width));
    let (mut from, mut until) = ([width, height], [0, 0]);
    for (row, (now, then)) in rows.enumerate() {
        let differs = |column: &usize| now[*column] != then[*column];
        let Some(first) = (0..width).find(differs) else {
            continue;
        };
        let last = (first..width).rfind(differs).unwrap_or(first);
        from = [from[0].min(first), from[1].min(row)];
        until = [until[0].max(last + 1), row + 1];
    }
    if until == [0, 0] {
        // The format has no empty frame, and a frame without change still takes its time.
        return [0, 0, 1, 1];
    }
    [from[0], from[1], until[0] - from[0], until[1] - from[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square that moves to the right.
    fn frame(nth: usize) -> Result<GifFrame, RasterError> {
        let svg = format!(
            "<svg xmlns='http://www.w3.org/2000/svg' width='40' height='10'><rect width='40' height='10' fill='#fff'/><rect x='{nth}' width='5' height='5' fill='#1668c7'/></svg>"
        );
        Ok(GifFrame {
            image: PixelImage::of(&svg, 1.0)?,
            duration_s: 0.1,
        })
    }

    /// Frames of a file as a viewer shows them, each with its duration.
    fn shown(file: &[u8]) -> Vec<(Vec<Rgb>, u16)> {
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(file).expect("a file");
        assert_eq!(decoder.repeat(), Repeat::Infinite);
        let width = usize::from(decoder.width());
        let mut canvas = vec![[0; 3]; width * usize::from(decoder.height())];
        let mut shown = Vec::new();
        while let Some(frame) = decoder.read_next_frame().expect("a frame") {
            for (nth, rgba) in frame.buffer.chunks_exact(4).enumerate() {
                let (row, column) = (
                    nth / usize::from(frame.width),
                    nth % usize::from(frame.width),
                );
                let at = (row + usize::from(frame.top)) * width + column + usize::from(frame.left);
                if rgba[3] != 0 {
                    canvas[at] = [rgba[0], rgba[1], rgba[2]];
                }
            }
            shown.push((canvas.clone(), frame.delay));
        }
        shown
    }

    #[test]
    fn a_file_plays_its_frames_in_a_loop() {
        let file = looping_gif((0..12).map(frame)).expect("a file");
        let shown = shown(&file);
        assert_eq!(shown.len(), 12);
        for (nth, (pixels, hundredths)) in shown.iter().enumerate() {
            let rgb = frame(nth).expect("a frame").image.rgb();
            assert_eq!((pixels.concat(), *hundredths), (rgb, 10), "frame {nth}");
        }
        assert_eq!(file, looping_gif((0..12).map(frame)).expect("a file"));
    }

    #[test]
    fn frames_that_are_left_out_lend_their_time_to_the_one_before() {
        let frames = (0..6).map(|nth| IndexedFrame {
            indices: vec![nth],
            hundredths: 10,
        });
        let kept = halved(frames.collect());
        let kept: Vec<_> = kept
            .iter()
            .map(|it| (it.indices[0], it.hundredths))
            .collect();
        // The last one shows the end.
        assert_eq!(kept, [(0, 20), (2, 20), (4, 10), (5, 10)]);
    }

    #[test]
    fn a_palette_has_the_frequent_colours_and_no_more_than_fit() {
        let many = (0..=255).flat_map(|red| (0..4).map(move |green| [red, green, 7]));
        let often = std::iter::repeat_n([9, 9, 200], 5);
        let pixels: Vec<Rgb> = many.chain(often).collect();
        let palette = palette(pixels.iter());
        assert_eq!((palette.len(), palette[0]), (COLOURS, [9, 9, 200]));
        assert_eq!(nearest_of([9, 8, 201], &palette), 0);
        let farthest = pixels
            .iter()
            .map(|rgb| distance_of(*rgb, palette[usize::from(nearest_of(*rgb, &palette))]));
        assert!(farthest.max() < Some(40));
    }

    #[test]
    fn frames_of_two_sizes_and_no_frame_are_refused() {
        let other = PixelImage::of(
            "<svg xmlns='http://www.w3.org/2000/svg' width='4' height='4'/>",
            1.0,
        );
        let other = other.map(|image| GifFrame {
            image,
            duration_s: 1.0,
        });
        assert!(looping_gif([frame(0), other]).is_err());
        assert!(looping_gif([]).is_err());
    }
}
