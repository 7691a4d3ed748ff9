-- Content-addressed blobs. The bytes are files; a row says that the file is complete and on disk.
create table artifact (
    digest         text    not null primary key
                           check (length(digest) = 71 and digest glob 'sha256-*' and substr(digest, 8) not glob '*[^0-9a-f]*'),
    size_bytes     integer not null check (size_bytes >= 0),
    create_time_ms integer not null,
    -- when somebody last uploaded it, or was told that it need not be uploaded: its time of grace begins here
    use_time_ms    integer not null
) strict, without rowid;

create index artifact_by_use on artifact (use_time_ms);

-- Whose artifacts are: who uploaded them, and whose jobs made them. Empty: nobody said.
create table artifact_owner (
    artifact text not null references artifact (digest) on delete cascade,
    owner    text not null check (length(owner) <= 128),
    primary key (artifact, owner)
) strict, without rowid;

-- What each owner has stored, so that nobody has to add it up. An artifact of two owners counts for both.
create table owner_bytes (
    owner text    not null primary key,
    bytes integer not null check (bytes >= 0)
) strict, without rowid;

create trigger artifact_is_somebodys after insert on artifact_owner
begin
    insert into owner_bytes select new.owner, size_bytes from artifact where digest = new.artifact
    on conflict do update set bytes = bytes + excluded.bytes;
end;

-- Before the delete: the trigger reads the size of the artifact, and who owns it, from rows that go with the artifact.
create trigger artifact_is_nobodys before delete on artifact
begin
    update owner_bytes set bytes = bytes - old.size_bytes
    where owner in (select owner from artifact_owner where artifact = old.digest);
end;
