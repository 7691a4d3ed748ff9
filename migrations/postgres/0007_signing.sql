-- Keyrings: which keys may sign manifests of kernels. The newest counts.
create table keyring (
    version        bigint           not null primary key check (version >= 1),
    -- the signed document
    document       text collate "C" not null,
    create_time_ms bigint           not null
);

create trigger keyring_stays before update on keyring for each row
execute function refuse('keyrings are append-only');

create trigger keyring_is_kept before delete on keyring for each row
execute function refuse('keyrings are append-only');

-- Private keys that this server has: of manifests, and the root key unless it is kept elsewhere.
create table signing_key (
    public         text collate "C" not null primary key check (length(public) = 64),
    -- PKCS#8 in PEM form
    private        text collate "C" not null,
    create_time_ms bigint           not null
);
