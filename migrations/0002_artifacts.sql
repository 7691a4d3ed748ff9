-- Content-addressed blobs. The bytes are files; a row says that the file is complete and on disk.
create table artifact (
    digest         text    not null primary key
                           check (length(digest) = 71 and digest glob 'sha256-*' and substr(digest, 8) not glob '*[^0-9a-f]*'),
    size_bytes     integer not null check (size_bytes >= 0),
    create_time_ms integer not null
) strict, without rowid;
