//! The finished pixels, and the PNG they go into.

use std::{
    fs::File,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

/// Colours of a picture's pixels, row by row from the top.
pub struct Picture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// sRGB.
    pub colours: Vec<[u8; 3]>,
}

/// A file that is open for a picture.
pub struct PngFile {
    path: PathBuf,
    file: File,
}

impl PngFile {
    /// Opens `path`, which has to end in `.png`: a mesh named there by mistake is not overwritten.
    pub fn create(path: &Path) -> Result<Self, String> {
        let is_png = path
            .extension()
            .is_some_and(|extension| extension.eq_ignore_ascii_case("png"));
        if !is_png {
            return Err(format!("{}: a picture's name ends in .png", path.display()));
        }
        match File::create(path) {
            Ok(file) => Ok(Self {
                path: path.to_owned(),
                file,
            }),
            Err(error) => Err(format!("{}: cannot be written: {error}", path.display())),
        }
    }

    /// Writes `picture`.
    pub fn write(self, picture: &Picture) -> Result<(), String> {
        let write = || -> Result<(), png::EncodingError> {
            let mut file = BufWriter::new(&self.file);
            let mut encoder = png::Encoder::new(&mut file, picture.width, picture.height);
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_depth(png::BitDepth::Eight);
            encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
            let mut writer = encoder.write_header()?;
            writer.write_image_data(picture.colours.as_flattened())?;
            writer.finish()?;
            Ok(file.flush()?)
        };
        write().map_err(|error| format!("{}: cannot be written: {error}", self.path.display()))
    }
}
