-- API tokens, known by their SHA-256 alone. A name is never given twice: the audit log means one token by it.
create table token (
    name           text    not null primary key check (length(name) between 1 and 63),
    hash           text    not null unique check (length(hash) = 64),
    role           text    not null check (role in ('viewer', 'submitter', 'curator', 'firmware', 'admin')),
    -- ids of the displays that it is for, as JSON; none: all
    displays       text    not null check (json_valid(displays)),
    create_time_ms integer not null,
    expire_time_ms integer,
    revoke_time_ms integer,
    -- a firmware token is for one display or several, never for all
    check (role <> 'firmware' or json_array_length(displays) > 0)
) strict, without rowid;

create trigger revoked_token_stays before update on token
when old.revoke_time_ms is not null and new.revoke_time_ms is not old.revoke_time_ms
begin select raise(abort, 'the token is revoked'); end;
