//! Rows of numbers in text files, plain or gzip-ed.

use super::ImportError;
use flate2::read::MultiGzDecoder;
use nalgebra::Vector3;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Largest text that is read, bytes after decompression: a hundred times the largest of the data sets.
const MAX_TEXT_BYTES: u64 = 256 << 20;

/// The text of a file, decompressed when its bytes begin like gzip.
pub(super) fn text_of(file: &Path) -> Result<String, ImportError> {
    let unreadable = |error| ImportError::Unreadable { file: file.to_owned(), error };
    let bytes = read_whole(File::open(file).map_err(unreadable)?).map_err(unreadable)?;
    text_of_bytes(bytes).map_err(unreadable)
}

/// The text in `bytes`, decompressed when they begin like gzip.
pub(super) fn text_of_bytes(bytes: Vec<u8>) -> io::Result<String> {
    let plain = if bytes.starts_with(&[0x1f, 0x8b]) { read_whole(MultiGzDecoder::new(&bytes[..]))? } else { bytes };
    String::from_utf8(plain).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error.utf8_error()))
}

/// Everything a reader holds; more than the limit is refused, not cut.
fn read_whole(reader: impl Read) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let n = reader.take(MAX_TEXT_BYTES + 1).read_to_end(&mut bytes)?;
    if n as u64 > MAX_TEXT_BYTES {
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, format!("more than {MAX_TEXT_BYTES} bytes of text")));
    }
    Ok(bytes)
}

/// The file with this name, or with `.gz` after it.
pub(super) fn existing(folder: &Path, name: &str) -> Option<PathBuf> {
    [folder.join(name), folder.join(format!("{name}.gz"))].into_iter().find(|file| file.is_file())
}

/// Numbers of a text, row by row, every row of the same width.
#[derive(Debug)]
pub(super) struct Table {
    n_columns: usize,
    values: Vec<f64>,
}

impl Table {
    /// Reads rows of exactly `n_columns` finite numbers that stand between commas, semicolons or blanks; empty rows and the first
    /// `n_header` rows are passed over. `file` is only named in errors.
    pub(super) fn parse(text: &str, n_header: usize, n_columns: usize, file: &Path) -> Result<Self, ImportError> {
        Self::parse_cells(text, n_header, n_columns, file, false)
    }

    fn parse_cells(
        text: &str,
        n_header: usize,
        n_columns: usize,
        file: &Path,
        allows_nan: bool,
    ) -> Result<Self, ImportError> {
        let mut values = Vec::new();
        for (i, row) in text.lines().enumerate().skip(n_header) {
            if row.trim().is_empty() {
                continue;
            }
            let malformed = |reason| ImportError::Malformed { file: file.to_owned(), row: i + 1, reason };
            let start = values.len();
            for cell in row.split(|c: char| matches!(c, ',' | ';') || c.is_whitespace()).filter(|c| !c.is_empty()) {
                match cell.parse::<f64>() {
                    Ok(value) if value.is_finite() || (allows_nan && value.is_nan()) => values.push(value),
                    _ => {
                        let shown: String = cell.chars().take(32).collect();
                        return Err(malformed(format!("`{shown}` is not a finite number")));
                    }
                }
            }
            if values.len() - start != n_columns {
                return Err(malformed(format!("{} numbers, expected {n_columns}", values.len() - start)));
            }
        }
        Ok(Self { n_columns, values })
    }

    /// Reads a file; see [`Table::parse`].
    pub(super) fn read(file: &Path, n_header: usize, n_columns: usize) -> Result<Self, ImportError> {
        Self::parse(&text_of(file)?, n_header, n_columns, file)
    }

    pub(super) fn n_rows(&self) -> usize {
        self.values.len() / self.n_columns
    }

    pub(super) fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.n_columns..(row + 1) * self.n_columns]
    }

    pub(super) fn column(&self, column: usize) -> Vec<f64> {
        self.values.iter().skip(column).step_by(self.n_columns).copied().collect()
    }

    /// Number of triples, from column 0 on, that are exactly 0, 0, 0.
    pub(super) fn n_zero_triples(&self) -> u64 {
        let zero = |triple: &&[f64]| triple.iter().all(|value| *value == 0.0);
        (0..self.n_rows()).map(|t| self.row(t).chunks_exact(3).filter(zero).count() as u64).sum()
    }
}

/// Numbers of a text under a row of names; a missing number is `nan`.
#[derive(Debug)]
pub(super) struct NamedTable {
    names: Vec<String>,
    table: Table,
    file: PathBuf,
}

impl NamedTable {
    /// Reads a file whose names stand after `n_before` other rows, between commas or tabulators.
    pub(super) fn read(file: &Path, n_before: usize) -> Result<Self, ImportError> {
        let text = text_of(file)?;
        let header = text.lines().nth(n_before).unwrap_or_default();
        let names: Vec<String> = header.split([',', '\t']).map(|name| name.trim().to_owned()).collect();
        let table = Table::parse_cells(&text, n_before + 1, names.len(), file, true)?;
        Ok(Self { names, table, file: file.to_owned() })
    }

    pub(super) fn n_rows(&self) -> usize {
        self.table.n_rows()
    }

    fn index(&self, name: &str) -> Result<usize, ImportError> {
        self.names.iter().position(|known| known == name).ok_or_else(|| ImportError::Inconsistent {
            file: self.file.clone(),
            reason: format!("there is no column `{name}`"),
        })
    }

    pub(super) fn column(&self, name: &str) -> Result<Vec<f64>, ImportError> {
        Ok(self.table.column(self.index(name)?))
    }

    /// The named columns of every row.
    pub(super) fn rows_of<const N: usize>(&self, names: [impl AsRef<str>; N]) -> Result<Vec<[f64; N]>, ImportError> {
        let mut columns = [0; N];
        for (column, name) in columns.iter_mut().zip(&names) {
            *column = self.index(name.as_ref())?;
        }
        Ok((0..self.n_rows()).map(|i| columns.map(|column| self.table.row(i)[column])).collect())
    }

    /// Three named columns as vectors.
    pub(super) fn vectors(&self, names: [impl AsRef<str>; 3]) -> Result<Vec<Vector3<f64>>, ImportError> {
        Ok(self.rows_of(names)?.into_iter().map(Vector3::from).collect())
    }
}
