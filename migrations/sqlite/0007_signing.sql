-- Keyrings: which keys may sign manifests of kernels. The newest counts.
create table keyring (
    version        integer not null primary key check (version >= 1),
    -- the signed document
    document       text    not null,
    create_time_ms integer not null
) strict, without rowid;

create trigger keyring_stays before update on keyring
begin select raise(abort, 'keyrings are append-only'); end;

create trigger keyring_is_kept before delete on keyring
begin select raise(abort, 'keyrings are append-only'); end;

-- Private keys that this server has: of manifests, and the root key unless it is kept elsewhere.
create table signing_key (
    public         text    not null primary key check (length(public) = 64),
    -- PKCS#8 in PEM form
    private        text    not null,
    create_time_ms integer not null
) strict, without rowid;
