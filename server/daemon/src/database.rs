//! The database of a server: a file in its data folder, or a database on a PostgreSQL server.

use lightpath_artifacts::{ArtifactError, Artifacts};
use lightpath_store::{Inspection, Store, StoreError};
use std::fmt;
use std::path::{Path, PathBuf};

/// Name of the database in the data folder.
pub const DATABASE: &str = "lightpath.db";

/// How the URLs of PostgreSQL databases begin.
const SCHEMES: [&str; 2] = ["postgres://", "postgresql://"];

/// Where the database is.
#[derive(Clone)]
pub enum Database {
    /// A file of SQLite in this data folder.
    InFolder(PathBuf),
    /// A database of PostgreSQL with this URL. The URL may contain a password.
    OnServer(String),
}

/// Why the database of a server could not be opened; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum DatabaseError {
    #[error("{} contains no {DATABASE}; give the data folder of the server with --data-dir", path.display())]
    NoData { path: PathBuf },
    #[error(
        "the artifacts of this database are in the data folder or bucket with the identity {recorded}, but the settings lead \
         to the one with {found}: set data_dir or artifacts_url to the other one, or database_url to another database"
    )]
    OtherArtifacts { recorded: String, found: String },
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Artifacts(#[from] ArtifactError),
}

impl fmt::Debug for Database {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Database {
    /// The database at `url`, or the file in `data_dir` if there is no URL; `None` if the URL is of another kind.
    #[must_use]
    pub fn of(data_dir: &Path, url: Option<&str>) -> Option<Self> {
        match url {
            Some(url) if SCHEMES.iter().any(|scheme| url.starts_with(scheme)) => Some(Self::OnServer(url.to_owned())),
            Some(_) => None,
            None => Some(Self::InFolder(data_dir.to_owned())),
        }
    }

    /// The name of the database in reports; without its password.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::InFolder(_) => DATABASE,
            Self::OnServer(_) => "database",
        }
    }

    /// Opens the database of a server that holds the data folder of `artifacts`.
    ///
    /// # Errors
    ///
    /// [`DatabaseError::OtherArtifacts`] if the artifacts of the database are in another place.
    pub async fn open(&self, artifacts: &Artifacts) -> Result<Store, DatabaseError> {
        match self {
            Self::InFolder(folder) => Ok(Store::open(&folder.join(DATABASE)).await?),
            Self::OnServer(url) => {
                let found = artifacts.identity().await?;
                let former = artifacts.former_identity().await?;
                let store = Store::connect(url).await?;
                let recorded = store.artifact_place(&found, former.as_deref()).await?;
                if recorded == found { Ok(store) } else { Err(DatabaseError::OtherArtifacts { recorded, found }) }
            }
        }
    }

    /// Opens a database that a server may be using. One whose tables have another version is refused.
    pub async fn open_shared(&self) -> Result<Store, StoreError> {
        match self {
            Self::InFolder(folder) => Store::open_shared(&folder.join(DATABASE)).await,
            Self::OnServer(url) => Store::connect_shared(url).await,
        }
    }

    /// Opens the database for reading.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::require`].
    pub async fn inspect(&self) -> Result<Inspection, DatabaseError> {
        match self {
            Self::InFolder(folder) => Ok(Inspection::open(&file_in(folder)?).await?),
            Self::OnServer(url) => Ok(Inspection::connect(url).await?),
        }
    }

    /// Makes sure that a server has used the database, so that no command makes a new one by mistake.
    ///
    /// # Errors
    ///
    /// [`DatabaseError::NoData`] if the data folder has no database; [`StoreError::EmptyDatabase`] if the one on the
    /// server has no tables.
    pub async fn require(&self) -> Result<(), DatabaseError> {
        match self {
            Self::InFolder(folder) => file_in(folder).map(drop),
            Self::OnServer(_) => Ok(self.inspect().await?.close().await?),
        }
    }
}

fn file_in(folder: &Path) -> Result<PathBuf, DatabaseError> {
    let file = folder.join(DATABASE);
    if file.is_file() { Ok(file) } else { Err(DatabaseError::NoData { path: folder.to_owned() }) }
}
