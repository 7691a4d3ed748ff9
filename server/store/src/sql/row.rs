//! Rows of either database, and the conversion of their columns.

use sqlx::postgres::PgRow;
use sqlx::sqlite::SqliteRow;
use sqlx::{Row as _, TypeInfo as _, ValueRef as _};

/// A row that a statement returned.
#[derive(Debug)]
pub(crate) enum Row {
    Sqlite(SqliteRow),
    Postgres(PgRow),
}

/// A column: its name or its number from 0.
#[derive(Clone, Copy)]
pub(crate) enum ColumnId<'n> {
    Name(&'n str),
    Number(usize),
}

impl<'n> From<&'n str> for ColumnId<'n> {
    fn from(name: &'n str) -> Self {
        Self::Name(name)
    }
}

impl From<usize> for ColumnId<'_> {
    fn from(number: usize) -> Self {
        Self::Number(number)
    }
}

/// Calls a method of a row of sqlx with a column.
macro_rules! at {
    ($row:expr, $method:ident $(::<$kind:ty>)?, $column:expr) => {
        match $column {
            ColumnId::Name(name) => $row.$method$(::<$kind, _>)?(name),
            ColumnId::Number(number) => $row.$method$(::<$kind, _>)?(number),
        }
    };
}

/// A value that a column can have.
pub(crate) trait Column: Sized {
    /// Reads the column.
    fn read(row: &Row, column: ColumnId<'_>) -> Result<Self, sqlx::Error>;
}

impl Row {
    /// The value of a column.
    pub(crate) fn try_get<'n, T: Column>(&self, column: impl Into<ColumnId<'n>>) -> Result<T, sqlx::Error> {
        T::read(self, column.into())
    }

    fn is_null(&self, column: ColumnId<'_>) -> Result<bool, sqlx::Error> {
        match self {
            Self::Sqlite(row) => Ok(at!(row, try_get_raw, column)?.is_null()),
            Self::Postgres(row) => Ok(at!(row, try_get_raw, column)?.is_null()),
        }
    }
}

impl Column for i64 {
    fn read(row: &Row, column: ColumnId<'_>) -> Result<Self, sqlx::Error> {
        match row {
            Row::Sqlite(row) => at!(row, try_get::<i64>, column),
            // A literal and the truth of an expression have types of their own there.
            Row::Postgres(row) => match at!(row, try_get_raw, column)?.type_info().name() {
                "INT4" => at!(row, try_get::<i32>, column).map(i64::from),
                "BOOL" => at!(row, try_get::<bool>, column).map(i64::from),
                _ => at!(row, try_get::<i64>, column),
            },
        }
    }
}

/// Integers that are stored in 64 bits.
macro_rules! narrow {
    ($($kind:ty),*) => {$(
        impl Column for $kind {
            fn read(row: &Row, column: ColumnId<'_>) -> Result<Self, sqlx::Error> {
                let wide = i64::read(row, column)?;
                Self::try_from(wide).map_err(|error| sqlx::Error::Decode(Box::new(error)))
            }
        }
    )*};
}

narrow!(i32, u32, u8, u64);

impl Column for bool {
    fn read(row: &Row, column: ColumnId<'_>) -> Result<Self, sqlx::Error> {
        Ok(i64::read(row, column)? != 0)
    }
}

impl Column for f64 {
    fn read(row: &Row, column: ColumnId<'_>) -> Result<Self, sqlx::Error> {
        match row {
            Row::Sqlite(row) => at!(row, try_get::<f64>, column),
            Row::Postgres(row) => at!(row, try_get::<f64>, column),
        }
    }
}

impl Column for String {
    fn read(row: &Row, column: ColumnId<'_>) -> Result<Self, sqlx::Error> {
        match row {
            Row::Sqlite(row) => at!(row, try_get::<String>, column),
            Row::Postgres(row) => at!(row, try_get::<String>, column),
        }
    }
}

impl<T: Column> Column for Option<T> {
    fn read(row: &Row, column: ColumnId<'_>) -> Result<Self, sqlx::Error> {
        if row.is_null(column)? { Ok(None) } else { T::read(row, column).map(Some) }
    }
}

/// Makes a value from a row. The fields before the semicolon have the names of their columns.
macro_rules! from_row {
    ($row:ident, $kind:ident { $($column:ident),* $(; $($rest:tt)*)? }) => {
        $kind { $($column: $row.try_get(stringify!($column))?,)* $($($rest)*)? }
    };
}
pub(crate) use from_row;

/// The columns of a row, in order.
pub(crate) trait Columns: Sized {
    fn of(row: &Row) -> Result<Self, sqlx::Error>;
}

/// Tuples of columns.
macro_rules! columns {
    ($($name:ident $number:literal),*) => {
        impl<$($name: Column),*> Columns for ($($name,)*) {
            fn of(row: &Row) -> Result<Self, sqlx::Error> {
                Ok(($(row.try_get::<$name>($number)?,)*))
            }
        }
    };
}

columns!(A 0, B 1);
columns!(A 0, B 1, C 2);
columns!(A 0, B 1, C 2, D 3);
