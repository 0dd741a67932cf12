//! The merged rows as a Parquet file, for tools that read columns.
//!
//! The type of a column is the common type of its cells: Boolean, integer, number or text.
//! An empty cell is null.

use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as PhysicalType};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{Type, TypePtr};

/// Why the Parquet file cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ColumnsError {
    /// The rows are not valid CSV.
    #[error("the merged rows cannot be read: {0}")]
    Csv(#[from] csv::Error),
    /// The rows cannot be written as columns.
    #[error("the merged rows cannot be written as Parquet: {0}")]
    Parquet(#[from] ParquetError),
}

/// One column; a cell without a value is `None`.
enum Column {
    Truth(Vec<Option<bool>>),
    Whole(Vec<Option<i64>>),
    Number(Vec<Option<f64>>),
    Text(Vec<Option<ByteArray>>),
}

impl Column {
    fn of(cells: &[&str]) -> Self {
        fn all<T>(cells: &[&str], read: impl Fn(&str) -> Option<T>) -> Option<Vec<Option<T>>> {
            cells
                .iter()
                .map(|cell| {
                    if cell.is_empty() {
                        Some(None)
                    } else {
                        read(cell).map(Some)
                    }
                })
                .collect()
        }
        if let Some(values) = all(cells, |cell| cell.parse().ok()) {
            Self::Truth(values)
        } else if let Some(values) = all(cells, |cell| cell.parse().ok()) {
            Self::Whole(values)
        } else if let Some(values) = all(cells, |cell| cell.parse().ok()) {
            Self::Number(values)
        } else {
            let text = |cell: &&str| (!cell.is_empty()).then(|| ByteArray::from(*cell));
            Self::Text(cells.iter().map(text).collect())
        }
    }

    fn schema(&self, name: &str) -> Result<TypePtr, ParquetError> {
        let (physical, logical) = match self {
            Self::Truth(_) => (PhysicalType::BOOLEAN, None),
            Self::Whole(_) => (PhysicalType::INT64, None),
            Self::Number(_) => (PhysicalType::DOUBLE, None),
            Self::Text(_) => (PhysicalType::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let builder = Type::primitive_type_builder(name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical);
        Ok(Arc::new(builder.build()?))
    }

    fn write(&self, mut writer: SerializedColumnWriter<'_>) -> Result<(), ParquetError> {
        fn parts<T: Clone>(cells: &[Option<T>]) -> (Vec<T>, Vec<i16>) {
            let values = cells.iter().flatten().cloned().collect();
            let levels = cells.iter().map(|cell| i16::from(cell.is_some())).collect();
            (values, levels)
        }
        match self {
            Self::Truth(cells) => {
                let (values, levels) = parts(cells);
                writer
                    .typed::<BoolType>()
                    .write_batch(&values, Some(&levels), None)?;
            }
            Self::Whole(cells) => {
                let (values, levels) = parts(cells);
                writer
                    .typed::<Int64Type>()
                    .write_batch(&values, Some(&levels), None)?;
            }
            Self::Number(cells) => {
                let (values, levels) = parts(cells);
                writer
                    .typed::<DoubleType>()
                    .write_batch(&values, Some(&levels), None)?;
            }
            Self::Text(cells) => {
                let (values, levels) = parts(cells);
                writer
                    .typed::<ByteArrayType>()
                    .write_batch(&values, Some(&levels), None)?;
            }
        }
        writer.close()
    }
}

/// Returns the rows of a CSV file as a Parquet file.
///
/// # Errors
/// [`ColumnsError`] if the rows cannot be read or written.
pub fn from_csv(text: &[u8]) -> Result<Vec<u8>, ColumnsError> {
    let mut reader = csv::Reader::from_reader(text);
    let names = reader.headers()?.clone();
    let rows: Vec<csv::StringRecord> = reader.records().collect::<Result<_, _>>()?;
    let columns: Vec<Column> = (0..names.len())
        .map(|field| {
            let cells: Vec<&str> = rows
                .iter()
                .map(|row| row.get(field).unwrap_or_default())
                .collect();
            Column::of(&cells)
        })
        .collect();
    let fields = names
        .iter()
        .zip(&columns)
        .map(|(name, column)| column.schema(name))
        .collect::<Result<_, _>>()?;
    let schema = Type::group_type_builder("rows")
        .with_fields(fields)
        .build()?;
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), properties)?;
    let mut group = writer.next_row_group()?;
    for column in &columns {
        if let Some(writer) = group.next_column()? {
            column.write(writer)?;
        }
    }
    group.close()?;
    Ok(writer.into_inner()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};

    #[test]
    fn columns_have_types_and_empty_cells_have_no_value() {
        let text = "index,mu,bouncing,fault\n0,0.5,true,\n1,1,false,lift-off\n";
        let file = from_csv(text.as_bytes()).unwrap();
        let mut on_disk = tempfile::tempfile().unwrap();
        std::io::Write::write_all(&mut on_disk, &file).unwrap();
        let reader = SerializedFileReader::new(on_disk).unwrap();
        let rows: Vec<String> = reader
            .get_row_iter(None)
            .unwrap()
            .map(|row| row.unwrap().to_string())
            .collect();
        assert_eq!(
            rows,
            [
                "{index: 0, mu: 0.5, bouncing: true, fault: null}",
                "{index: 1, mu: 1.0, bouncing: false, fault: \"lift-off\"}",
            ]
        );
    }
}
