//! Colour images.

/// One colour image: red, green and blue of 8 bits each, row by row from the upper left corner.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ColourImage {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width · height` pixels.
    pub pixels: Vec<[u8; 3]>,
}

impl ColourImage {
    /// A black image.
    pub fn black(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![[0; 3]; width * height] }
    }
}
