//! CSV files with two columns: a quantity over time or along the belt.

use std::path::Path;

use painleve_files::input_file;

use super::from_file::check_permitted;

/// Largest number of rows.
const MOST_ROWS: usize = 1_000_000;
/// Largest magnitude of a time or position.
const FARTHEST: f64 = 1e7;

/// The columns of a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Columns {
    /// Name of the first column, which must increase.
    pub place: &'static str,
    /// Name of the second column.
    pub value: &'static str,
    /// Largest magnitude of a value.
    pub largest: f64,
}

/// Reads a file whose first line names one of the allowed pairs of columns; returns the index of this
/// pair and at least `least` rows.
///
/// # Errors
/// One sentence with the path, the line, the column and what is allowed.
pub(crate) fn read(
    path: &str,
    allowed: &[Columns],
    least: usize,
) -> Result<(usize, Vec<(f64, f64)>), String> {
    check_permitted(path)?;
    let text = input_file::read(Path::new(path))
        .map_err(|error| format!("cannot read {path}: {error}"))?;
    let (pair, points) = parse(&text, allowed).map_err(|reason| format!("{path}: {reason}"))?;
    if points.len() < least {
        let rows = if least == 1 { "one row" } else { "two rows" };
        return Err(format!("{path}: it needs at least {rows} of numbers"));
    }
    Ok((pair, points))
}

fn parse(text: &str, allowed: &[Columns]) -> Result<(usize, Vec<(f64, f64)>), String> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut records = reader.records();
    let head = records.next().transpose().map_err(|it| it.to_string())?;
    let head = head.unwrap_or_default();
    let names: Vec<&str> = head.iter().collect();
    let pair = allowed
        .iter()
        .position(|one| names == [one.place, one.value]);
    let Some(pair) = pair else {
        let pairs = allowed
            .iter()
            .map(|one| format!("{},{}", one.place, one.value));
        let pairs: Vec<String> = pairs.collect();
        return Err(format!(
            "line 1 is '{}'; it must be {}",
            names.join(","),
            pairs.join(" or ")
        ));
    };
    let columns = allowed[pair];
    let mut points: Vec<(f64, f64)> = Vec::new();
    for record in records {
        let record = record.map_err(|error| error.to_string())?;
        let number = record.position().map_or(0, csv::Position::line);
        let mut values = record.iter().map(|value| value.parse().ok());
        let (Some(Some(place)), Some(Some(value)), None) =
            (values.next(), values.next(), values.next())
        else {
            let line = record.iter().collect::<Vec<_>>().join(",");
            return Err(format!("line {number} is '{line}'; it must be two numbers"));
        };
        let check = |column: &str, value: f64, largest: f64| {
            if value.abs() <= largest {
                Ok(())
            } else {
                Err(format!(
                    "line {number}: {column} = {value} is outside the allowed range -{largest} to {largest}"
                ))
            }
        };
        check(columns.place, place, FARTHEST)?;
        check(columns.value, value, columns.largest)?;
        if points.last().is_some_and(|&(before, _)| place <= before) {
            return Err(format!(
                "line {number}: {} = {place} is not larger than in the row before",
                columns.place
            ));
        }
        if points.len() == MOST_ROWS {
            return Err(format!("it has more than {MOST_ROWS} rows"));
        }
        points.push((place, value));
    }
    Ok((pair, points))
}

/// Interpolates linearly between the rows; before the first and after the last one the value is
/// constant.
pub(crate) fn interpolated(points: &[(f64, f64)], place: f64) -> f64 {
    let after = points.partition_point(|&(at, _)| at <= place);
    match (points.get(after.wrapping_sub(1)), points.get(after)) {
        (Some(&(from, one)), Some(&(to, other))) => {
            one + (other - one) * ((place - from) / (to - from))
        }
        (Some(&(_, value)), None) | (None, Some(&(_, value))) => value,
        (None, None) => 0.0,
    }
}
